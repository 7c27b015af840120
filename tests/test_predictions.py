"""The answer type of all forecasters, its files, and the metrics of several modes."""

import dataclasses

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.errors import InputError, ValueRuleError
from pedpred.evaluation.forecasts import read_windows, write_windows
from pedpred.geometry import rotate
from pedpred.metrics import METRICS
from pedpred.scenes import Predictions
from tests.forecasts import drawn_predictions, metric_scene, windows_with
from tests.refused import refused

SEEDS = st.integers(0, 2**32 - 1)


def value(key, predictions, truth):
    return METRICS[key].value(predictions, truth, metric_scene(len(predictions)))


def test_weights_must_fall_and_sum_to_one():
    for weight in ([0.4, 0.6], [0.6, 0.6], [1.1, -0.1]):
        with pytest.raises(ValueRuleError):
            Predictions(np.zeros((1, 3, 2)), np.zeros((1, 2, 3, 2)), np.array([weight]), 0.3)


def test_shapes_that_do_not_belong_together_are_named():
    given_ = drawn_predictions(np.random.default_rng(0))
    for name in ("path", "weight", "covariance"):
        with refused(name):
            dataclasses.replace(given_, **{name: getattr(given_, name)[1:]})


@given(SEEDS)
def test_a_single_mode_is_the_point_forecast(seed):
    point = np.random.default_rng(seed).normal(size=(4, 3, 2))
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


@given(SEEDS, st.floats(-4.0, 4.0))
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


@settings(max_examples=25)
@given(SEEDS)
def test_more_modes_never_raise_the_least_error(seed):
    rng = np.random.default_rng(seed)
    given_, truth = drawn_predictions(rng, modes=6), rng.normal(size=(5, 4, 2))
    for key in ("min_ade_m", "min_fde_m", "miss_rate"):
        few, some, many = (value(f"{key}_k{k}", given_, truth) for k in (1, 3, 6))
        assert (few >= some).all()
        assert (some >= many).all()
    same = (value(key, given_, truth) for key in ("min_ade_m_k1", "most_likely_ade_m"))
    np.testing.assert_array_equal(*same)


def test_the_energy_score_is_least_for_the_true_spread():
    rng = np.random.default_rng(3)
    truth, scores = rng.normal(size=(4000, 1, 2)), {}
    for deviation in (0.5, 1.0, 2.0):
        covariance = np.tile(deviation**2 * np.eye(2), (4000, 1, 1, 1))
        given_ = Predictions.single(np.zeros((4000, 1, 2)), 0.3, covariance)
        scores[deviation] = value("energy_score_m", given_, truth).mean()
    assert scores[1.0] < min(scores[0.5], scores[2.0])


@pytest.mark.parametrize("damage", ["a wrong interval", "no heading"])
def test_a_damaged_file_of_forecasts_is_named(damage, tmp_path):
    path = tmp_path / "hall.parquet"
    write_windows(windows_with(np.zeros((5, 2)), np.zeros((5, 4, 2)), {"cv": np.zeros((5, 4, 2))}), path)
    table = pq.read_table(path)
    if damage == "no heading":
        table = table.drop_columns(["heading_rad"])
    about = {key: raw.replace(b'"dt_s": 0.3', b'"dt_s": -0.3') for key, raw in table.schema.metadata.items()}
    pq.write_table(table if damage == "no heading" else table.replace_schema_metadata(about), path)
    with pytest.raises(InputError) as error:
        read_windows(path)
    assert error.value.path == path
