"""The literature's protocol: its windows, its errors by hand, and by a few independent lines on real data."""

import numpy as np
import pytest

from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.errors import ValueRuleError
from pedpred.evaluation import EvaluationSettings, measure, summarise_methods
from pedpred.evaluation.observed import WindowSettings, consecutive_rows, find_observed_windows
from pedpred.features.perception import Perception
from pedpred.scenes import Scene, Trajectories
from pedpred.tracking import KalmanBank, KalmanSettings
from tests.worlds import EXCERPT, empty_map, recorded

SETTINGS = KalmanSettings(acceleration_noise=0.03, position_noise_m=0.05, initial_speed_mps=1.0)


def walk(positions, step_s=0.4, track=7, start_s=0.0):
    positions = np.asarray(positions, float)
    steps = np.arange(len(positions))
    return Trajectories(start_s + step_s * steps, np.full(len(steps), track), positions)


def joined(*recordings):
    parts = zip(*((r.time_s, r.track_id, r.position) for r in recordings), strict=True)
    return Trajectories(*map(np.concatenate, parts))


def windows_of(trajectories, observed, predicted, step_s=0.4):
    sizes = WindowSettings(observed_steps=observed, predicted_steps=predicted, step_s=step_s)
    scene = Scene("walk", trajectories, empty_map(), step_s)
    return find_observed_windows(scene, Perception(KalmanBank((SETTINGS,)), 0.0), sizes, memory=False)


def paths(found, method):
    return PRESENT_MOTION[method]()(found.request).point


def measured(found):
    how = EvaluationSettings(bootstrap=10)
    scores = measure(found, {key: make() for key, make in PRESENT_MOTION.items()}, how)
    return summarise_methods(scores, "kalman_cv", how)


def test_errors_by_hand():
    """Seen 0, 1 m; forecast 2, 3 m; true 2, 5 m: off by 0 and 2 m."""
    found = windows_of(walk([[0, 0], [1, 0], [2, 0], [5, 0]]), 2, 2)
    np.testing.assert_allclose(paths(found, "cv"), [[[2, 0], [3, 0]]])
    figures = measured(found)["cv"]
    assert (figures["ade_m"], figures["fde_m"], figures["windows"], figures["tracks"]) == (1.0, 2.0, 1, 1)


def test_a_constant_acceleration_is_continued():
    """x = 0, 1, 4: the last velocity is 3 per step, the acceleration 2 per step^2; on to x = 4 + 3 + 1."""
    found = windows_of(walk([[0, 0], [1, 0], [4, 0], [9, 0]]), 3, 1)
    np.testing.assert_allclose(paths(found, "ca"), [[[8, 0]]])


def test_a_window_is_full_or_is_none():
    line = np.column_stack([np.arange(9.0), np.zeros(9)])
    gap = joined(walk(line[:4]), walk(line[4:], start_s=2.0))
    other = walk(line[:3], track=8)
    whole = joined(gap, other)
    found = consecutive_rows(whole, 3, 0.4)
    assert whole.track_id[found[:, 0]].tolist() == [7] * 5 + [8]
    assert np.ptp(np.diff(whole.position[found], axis=1)[..., 0]) == 0
    assert consecutive_rows(walk(line[:2]), 3, 0.4).shape == (0, 3)
    with pytest.raises(ValueRuleError, match="windows"):
        windows_of(walk(line[:2]), 2, 1)


def test_on_a_straight_walk_everybody_is_right():
    found = windows_of(walk(np.outer(np.arange(30), [0.5, 0.2])), 8, 12)
    assert len(found.track) == 11
    for method in PRESENT_MOTION:
        tolerance_m = 0.05 if method == "kalman_cv" else 1e-9  # the filter starts from standing people
        np.testing.assert_allclose(paths(found, method), found.truth, atol=tolerance_m)


def last_step_errors(track_id, position):
    """Errors of constant velocity in all windows, m; rows rise in time, tracks have no holes. [W, 12]."""
    errors = []
    for track in np.unique(track_id):
        path = position[track_id == track]
        for k in range(len(path) - 19):
            going = path[k + 7] + np.outer(np.arange(1, 13), path[k + 7] - path[k + 6])
            errors.append(np.hypot(*(going - path[k + 8 : k + 20]).T))
    return errors


@pytest.mark.parametrize(
    ("place", "ade_m", "fde_m"),
    [(EXCERPT, 0.437, 1.039), ("eth", 0.678, 1.344), ("hotel", 0.344, 0.657)],
)
def test_real_last_step_errors_are_those_of_a_few_lines(place, ade_m, fde_m):
    trajectories = recorded(place).trajectories
    errors = last_step_errors(trajectories.track_id, trajectories.position)
    found = windows_of(trajectories, 8, 12)
    results = measured(found)
    figures, tracked = results["cv"], results["kalman_cv"]
    assert figures["windows"] == len(errors)
    assert figures["ade_m"] == pytest.approx(np.mean(errors), abs=1e-5) == pytest.approx(ade_m, abs=5e-4)
    assert figures["fde_m"] == pytest.approx(np.mean(errors, axis=0)[-1], abs=1e-5)
    assert figures["fde_m"] == pytest.approx(fde_m, abs=5e-4)
    if place != EXCERPT:  # splines carry no noise that a filter could take away
        assert tracked["ade_m"] < figures["ade_m"]
