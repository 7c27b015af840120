"""The answer type of all forecasters, its moments and frames, and its files."""

import dataclasses

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.errors import ValueRuleError
from pedpred.evaluation.forecasts import read_windows, write_windows
from pedpred.geometry import rotate
from pedpred.scenes import Predictions
from tests.forecasts import drawn_predictions, windows_with
from tests.refused import refused, unread


def test_weights_fall_and_sum_to_one():
    for weight in ([0.4, 0.6], [0.6, 0.6], [1.1, -0.1]):
        with refused("weight"):
            Predictions(np.zeros((1, 3, 2)), np.zeros((1, 2, 3, 2)), np.array([weight]), 0.3)


def test_shapes_that_do_not_belong_together_are_refused():
    given_ = drawn_predictions(np.random.default_rng(0))
    for name in ("path", "weight", "covariance"):
        with refused(name):
            dataclasses.replace(given_, **{name: getattr(given_, name)[1:]})


def test_a_single_mode_is_the_point_forecast():
    point = np.random.default_rng(0).normal(size=(4, 3, 2))
    single = Predictions.single(point, 0.3)
    assert (single.modes, single.steps, len(single)) == (1, 3, 4)
    for same in (single.most_likely, single.mean, single.sample(1, np.random.default_rng(0))[:, 0]):
        np.testing.assert_array_equal(same, point)


def test_samples_have_the_moments_of_the_mixture():
    given_ = drawn_predictions(np.random.default_rng(1), rows=2, steps=2)
    drawn = given_.sample(200_000, np.random.default_rng(2))
    weight = given_.weight[:, :, None, None]
    np.testing.assert_allclose(drawn.mean(axis=1), given_.mean, atol=0.03)
    apart = given_.path - given_.mean[:, None]
    spread = apart[..., :, None] * apart[..., None, :] + given_.covariance
    expected = (weight[..., None] * spread).sum(axis=1)
    apart = drawn - given_.mean[:, None]
    found = (apart[..., :, None] * apart[..., None, :]).mean(axis=1)
    np.testing.assert_allclose(found, expected, atol=0.03 * np.abs(expected).max())


@given(st.integers(0, 2**32 - 1), st.floats(-4.0, 4.0))
def test_predictions_turn_and_move_with_the_people(seed, angle):
    rng = np.random.default_rng(seed)
    local, position = drawn_predictions(rng, frame="agent"), rng.normal(size=(5, 2))
    heading, turn = rng.uniform(-3, 3, 5), np.full(5, angle)
    world = local.in_world(position, heading)
    turned = local.in_world(rotate(position, turn) + 1.0, heading + angle)
    np.testing.assert_allclose(turned.path, rotate(world.path, turn[:, None, None]) + 1.0, atol=1e-9)
    np.testing.assert_allclose(turned.point, rotate(world.point, turn[:, None]) + 1.0, atol=1e-9)
    for own in (local, turned):
        np.testing.assert_allclose(np.linalg.det(own.covariance), np.linalg.det(world.covariance), rtol=1e-6)
    with pytest.raises(ValueRuleError):
        world.in_world(position, heading)


@pytest.mark.parametrize("damage", ["a wrong interval", "no heading"])
def test_a_damaged_file_of_forecasts_is_named(damage, tmp_path):
    path = tmp_path / "hall.parquet"
    write_windows(windows_with(np.zeros((5, 2)), np.zeros((5, 4, 2)), {"cv": np.zeros((5, 4, 2))}), path)
    table = pq.read_table(path)
    if damage == "no heading":
        table = table.drop_columns(["heading_rad"])
    else:
        about = table.schema.metadata.items()
        table = table.replace_schema_metadata({k: v.replace(b'_s": 0.3', b'_s": -0.3') for k, v in about})
    pq.write_table(table, path)
    with unread(path):
        read_windows(path)
