"""Measures: hand-computed values, and no dependence on order or batch."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.baselines.kinematic import constant_acceleration, constant_velocity, kalman_velocity
from pedpred.baselines.registry import baseline
from pedpred.errors import ConfigError, ValueRuleError
from pedpred.evaluation import Scores, pooled, score, summary
from pedpred.evaluation.compare import compare, seen_together
from pedpred.evaluation.metrics import bootstrap_interval, displacement, inside_obstacle, too_close
from pedpred.evaluation.scores import true_paths, world_paths
from pedpred.features import FeatureSettings, extract
from pedpred.scenes import Scene, Trajectories
from pedpred.tracking import KalmanSettings, follow
from tests.worlds import empty_map, walled_scene

AHEAD_S = (np.arange(10) + 1) * 0.3


def table_of(scene):
    return extract(
        scene,
        follow(scene.trajectories, "kalman", KalmanSettings(0.1, 0.1), 0.2),
        FeatureSettings(phase_offsets=3),
    )


@pytest.fixture(scope="module")
def windows():
    table = table_of(walled_scene(np.random.default_rng(1), detections=60))
    return table.select(table.window)


def test_displacement_by_hand():
    paths, truth = np.zeros((1, 2, 2)), np.array([[[3.0, 4.0], [0.0, 1.0]]])
    np.testing.assert_allclose(displacement(paths, truth), [[5.0, 1.0]])


def test_too_close_by_hand():
    apart, near, other_time = np.zeros((1, 2)), np.full((1, 2), 0.1), np.zeros((1, 2))
    paths = np.stack([apart, near, other_time, np.full((1, 2), 5.0)])
    hits = too_close(paths, np.array([0.0, 0.0, 1.0, 0.0]), 0.2)
    assert hits.tolist() == [True, True, False, False]


def test_inside_obstacle_by_hand():
    room = empty_map()
    occupied = room.occupied.copy()
    occupied[room.occupied.shape[0] // 2 :] = True
    room = dataclasses.replace(room, occupied=occupied)
    assert inside_obstacle(np.array([[[1.0, 0.0], [-1.0, 0.0], [99.0, 0.0]]]), room).tolist() == [
        [True, False, False]
    ]


@given(st.integers(0, 2**32 - 1))
def test_order_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    paths, time_s = rng.normal(size=(20, 3, 2)), rng.integers(0, 4, 20).astype(float)
    order = rng.permutation(20)
    np.testing.assert_array_equal(
        too_close(paths, time_s, 0.5)[order], too_close(paths[order], time_s[order], 0.5)
    )


@given(st.integers(0, 2**32 - 1))
def test_summary_of_parts_pools_to_the_whole(seed):
    rng = np.random.default_rng(seed)

    def part(windows):
        return Scores(
            rng.integers(0, 5, windows),
            rng.random(windows) < 0.5,
            rng.random((windows, 10)),
            rng.random((windows, 10)) < 0.1,
            rng.random(windows) < 0.1,
            rng.exponential(2.0, (windows, 10)),
            rng.normal(size=(windows, 10)),
        )

    a, b = part(30), part(20)
    whole = pooled([a, b])
    assert len(np.unique(whole.track)) == len(np.unique(a.track)) + len(np.unique(b.track))
    total = summary(whole, whole, 10, 0)
    assert total["ade_m"] == pytest.approx((a.error_m.sum() + b.error_m.sum()) / 500, abs=1e-5)
    assert total["minus_kalman_cv_m"] == 0
    assert total["nll"] == pytest.approx((a.nll.sum() + b.nll.sum()) / 500, abs=1e-5)


def test_bootstrap_resamples_tracks_not_windows():
    """Windows of a track that repeat each other add no certainty."""
    rng = np.random.default_rng(0)
    per_track = rng.normal(1.0, 0.3, 40)
    once = bootstrap_interval(per_track, np.arange(40), 2000, np.random.default_rng(1))
    often = bootstrap_interval(
        np.repeat(per_track, 25), np.repeat(np.arange(40), 25), 2000, np.random.default_rng(1)
    )
    np.testing.assert_allclose(once, often)
    assert once[0] < per_track.mean() < once[1]
    spread = 2 * 1.96 * per_track.std() / np.sqrt(40)
    assert once[1] - once[0] == pytest.approx(spread, rel=0.2)


def test_baselines_are_exact_on_what_they_assume():
    time_s = np.arange(40) * 0.4
    for bend, forecast in ((0.0, constant_velocity), (0.2, constant_acceleration)):
        x = 1.2 * time_s + 0.5 * bend * time_s**2
        walk = Trajectories(time_s, np.zeros(40), np.stack([x, 0 * x], axis=-1))
        table = table_of(Scene("walk", walk, empty_map(), 0.4))
        windows = table.select(table.window)
        error = displacement(forecast(windows, AHEAD_S), true_paths(windows, 0.3))
        # Differences give the velocity half an interval ago: with a bend of 0.2 m/s^2 that is 4 cm/s.
        assert error.max() < (0.13 if bend else 1e-6)


def test_zero_residual_is_kalman_constant_velocity(windows):
    still = np.repeat(windows.velocity[:, None], 10, axis=1)
    np.testing.assert_allclose(world_paths(windows, still, 0.3), kalman_velocity(windows, AHEAD_S), atol=1e-5)


def test_a_perfect_forecast_scores_zero(windows):
    truth = true_paths(windows, 0.3)
    perfect = score(windows, truth, truth, empty_map(), 0.3, 0.2)
    assert summary(perfect, perfect, 10, 0)["ade_m"] == 0
    assert perfect.moving.mean() > 0.9


def test_everybody_at_a_window_moves_along_once():
    table = table_of(walled_scene(np.random.default_rng(2), detections=60))
    together = table.select(seen_together(table))
    keys = list(zip(together.track_id, np.round(together.time_s, 4), strict=True))
    assert len(keys) == len(set(keys))
    assert set(np.round(table.time_s[table.window], 4)) == set(np.round(together.time_s, 4))


def test_unknown_baseline_is_named():
    with pytest.raises(ConfigError, match="crystal_ball"):
        baseline("crystal_ball")


def test_a_scene_without_windows_says_so():
    scene = walled_scene(np.random.default_rng(1))
    options = {"moving_mps": 0.3, "collision_m": 0.2, "imagined_goals": 1}
    table = table_of(scene)
    table = dataclasses.replace(table, window=np.zeros(len(table), bool))
    with pytest.raises(ValueRuleError, match="nobody in walled is detected 4 times and 3 s longer"):
        compare(scene, table, FeatureSettings(phase_offsets=3), {}, ["cv"], options, {}, None)
