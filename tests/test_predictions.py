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
from pedpred.metrics.calibration import mixture_nll
from pedpred.scenes import Predictions
from tests.forecasts import drawn_predictions, metric_scene, windows_with

SEEDS = st.integers(0, 2**32 - 1)


def value(key, predictions, truth):
    return METRICS[key].value(predictions, truth, metric_scene(len(predictions)))


def test_weights_must_fall_and_sum_to_one():
    for weight in ([0.4, 0.6], [0.6, 0.6], [1.1, -0.1]):
        with pytest.raises(ValueRuleError, match="weight"):
            Predictions(np.zeros((1, 3, 2)), np.zeros((1, 2, 3, 2)), np.array([weight]), 0.3)


def test_shapes_that_do_not_belong_together_are_named():
    given_ = drawn_predictions(np.random.default_rng(0))
    for name in ("path", "weight", "covariance"):
        with pytest.raises(ValueRuleError, match=name):
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
def test_turning_and_moving_the_people_turns_and_moves_their_predictions(seed, angle):
    rng = np.random.default_rng(seed)
    local, position = drawn_predictions(rng, frame="agent"), rng.normal(size=(5, 2))
    heading, turn = rng.uniform(-3, 3, 5), np.full(5, angle)
    world = local.in_world(position, heading)
    turned = local.in_world(rotate(position, turn) + 1.0, heading + angle)
    np.testing.assert_allclose(turned.path, rotate(world.path, turn[:, None, None]) + 1.0, atol=1e-9)
    np.testing.assert_allclose(turned.point, rotate(world.point, turn[:, None]) + 1.0, atol=1e-9)
    for own in (local, turned):
        np.testing.assert_allclose(np.linalg.det(own.covariance), np.linalg.det(world.covariance), rtol=1e-6)
    with pytest.raises(ValueRuleError, match="frame"):
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


def test_mixture_likelihood_by_hand():
    """Two unit Gaussians at x = 0 and 2 with weights 0.75 and 0.25, the truth at 0."""
    path = np.array([[[[0.0, 0.0]], [[2.0, 0.0]]]])
    given_ = Predictions(path[:, 0], path, np.array([[0.75, 0.25]]), 0.3, np.tile(np.eye(2), (1, 2, 1, 1, 1)))
    expected = -np.log((0.75 + 0.25 * np.exp(-2.0)) / (2 * np.pi))
    np.testing.assert_allclose(mixture_nll(given_, np.zeros((1, 1, 2))), [[expected]])


def test_energy_score_by_hand():
    """Modes 1 and 3 m off with weights 0.5: 2 m on average, minus half of 0.5 * 2 m apart."""
    path = np.array([[[[1.0, 0.0]], [[3.0, 0.0]]]])
    given_ = Predictions(path[:, 0], path, np.array([[0.5, 0.5]]), 0.3)
    assert value("energy_score_m", given_, np.zeros((1, 1, 2))) == pytest.approx(1.5)


def test_the_energy_score_is_least_for_the_true_spread():
    rng = np.random.default_rng(3)
    truth, scores = rng.normal(size=(4000, 1, 2)), {}
    for deviation in (0.5, 1.0, 2.0):
        covariance = np.tile(deviation**2 * np.eye(2), (4000, 1, 1, 1))
        given_ = Predictions.single(np.zeros((4000, 1, 2)), 0.3, covariance)
        scores[deviation] = value("energy_score_m", given_, truth).mean()
    assert scores[1.0] < min(scores[0.5], scores[2.0])


def test_the_energy_score_of_gaussians_by_hand():
    """E|Z| = s sqrt(pi / 2) of a round Gaussian with deviation s; X - X' of two has sqrt(2) s."""
    rng = np.random.default_rng(3)
    truth = rng.normal(size=(20000, 1, 2))
    covariance = np.tile(np.eye(2), (20000, 2, 1, 1, 1))
    path = np.zeros((20000, 2, 1, 2))
    both = Predictions(path[:, 0], path, np.tile([0.7, 0.3], (20000, 1)), 0.3, covariance)
    one = Predictions.single(path[:, 0], 0.3, covariance[:, 0])
    for given_ in (one, both):
        assert value("energy_score_m", given_, truth).mean() == pytest.approx(np.sqrt(np.pi) / 2, abs=0.005)
    far = value("energy_score_m", one, truth + np.array([1000.0, 0.0])).mean()
    assert far == pytest.approx(1000 - np.sqrt(np.pi) / 2, abs=0.05)


def test_windows_are_read_as_they_were_written(tmp_path):
    rng = np.random.default_rng(4)
    methods = {"one": drawn_predictions(rng, modes=1), "many": drawn_predictions(rng)}
    methods["bare"] = Predictions.single(methods["one"].point, 0.3)
    sizes = {"grid_cells": 8, "grid_resolution_m": 0.25, "max_range_m": 9.0}
    crops = rng.integers(0, 256, (5, 8)).astype(np.uint8)
    windows = windows_with(np.zeros((5, 2)), rng.normal(size=(5, 4, 2)), {}, packed_grid=crops, **sizes)
    windows = dataclasses.replace(windows, predictions=methods)
    write_windows(windows, tmp_path / "hall.parquet")
    found = read_windows(tmp_path / "hall.parquet")
    assert {name: getattr(found, name) for name in sizes} == sizes
    assert (found.dt_s, found.grid(0).shape) == (windows.dt_s, (8, 8))
    np.testing.assert_allclose(found.truth, windows.truth, rtol=1e-6)
    for method, own in methods.items():
        for name in ("point", "path", "weight", "covariance"):
            kept, given_ = getattr(found.predictions[method], name), getattr(own, name)
            assert (kept is None) == (given_ is None)
            if kept is not None:
                np.testing.assert_allclose(kept, given_, rtol=1e-6, atol=1e-6)
    columns = pq.read_schema(tmp_path / "hall.parquet").names
    assert [name for name in columns if name.startswith("modes_")] == ["modes_many"]


def test_forecasts_that_break_a_rule_are_refused_with_the_name_of_their_file(tmp_path):
    path = tmp_path / "hall.parquet"
    write_windows(windows_with(np.zeros((5, 2)), np.zeros((5, 4, 2)), {"cv": np.zeros((5, 4, 2))}), path)
    table = pq.read_table(path)
    about = {key: raw.replace(b'"dt_s": 0.3', b'"dt_s": -0.3') for key, raw in table.schema.metadata.items()}
    pq.write_table(table.replace_schema_metadata(about), path)
    with pytest.raises(InputError, match=r"hall\.parquet.*dt_s = -0\.3"):
        read_windows(path)


def test_a_missing_column_is_named(tmp_path):
    path = tmp_path / "hall.parquet"
    write_windows(windows_with(np.zeros((5, 2)), np.zeros((5, 4, 2)), {}), path)
    pq.write_table(pq.read_table(path).drop_columns(["heading_rad"]), path)
    with pytest.raises(InputError, match="heading_rad"):
        read_windows(path)
