"""Windows of observed annotations, their short recordings, and errors of the nearest path, by hand."""

from dataclasses import replace

import numpy as np

from pedpred.evaluation.measure import BEST_ADE, BEST_FDE, best_of
from pedpred.evaluation.observed import (
    WindowSettings,
    consecutive_rows,
    find_observed_windows,
    short_recordings,
)
from pedpred.evaluation.windows import integrate_truth
from pedpred.features.perception import Perception
from pedpred.scenes import Predictions, Scene, Trajectories
from pedpred.tracking import KalmanSettings
from stages.rows import training_rows
from tests.worlds import empty_map

SETTINGS = WindowSettings(observed_steps=2, predicted_steps=1, step_s=0.4)
TIME_S = np.array([1.2, 0.4, 0.8, 0.0, 0.4, 0.8])
TRACK = np.array([7, 7, 7, 7, 9, 9])
PLACE = np.arange(12.0).reshape(6, 2)


def test_each_instant_has_a_recording_of_who_is_annotated_then():
    """Track 9 is not annotated at 1.2 s, so that its annotation at 0.8 s is left out of the second one."""
    found = short_recordings(Trajectories(TIME_S, TRACK, PLACE), np.array([0.8, 1.2]), SETTINGS)
    rows = zip(found.time_s.tolist(), found.track_id.tolist(), found.position.tolist(), strict=True)
    place = {key: PLACE[row].tolist() for key, row in (("7 at 0.4", 1), ("7 at 0.8", 2), ("7 at 1.2", 0))}
    expected = [
        *((-0.4, 0, place["7 at 0.4"]), (0.0, 0, place["7 at 0.8"])),
        *((-0.4, 1, PLACE[4].tolist()), (0.0, 1, PLACE[5].tolist())),
        *((999.6, 2, place["7 at 0.8"]), (1000.0, 2, place["7 at 1.2"])),
    ]
    assert sorted(rows) == sorted(expected)


def test_annotations_may_be_late_by_a_millisecond_per_step():
    """The first clock loses 0.9 ms at each step, the second is late at last, the third too late at 1.5 ms."""
    settings = replace(SETTINGS, observed_steps=3)
    time_s = np.array([10.0, 9.5991, 9.1982, 10.0004, 9.6, 10.0015, 9.6, 20.0])
    people = Trajectories(time_s, np.array([1, 1, 1, 2, 2, 3, 3, 3]), np.zeros((8, 2)))
    found = short_recordings(people, np.array([10.0, 20.0]), settings)
    rows = sorted(zip(found.track_id.tolist(), found.time_s.tolist(), strict=True))
    assert rows == [(0, -0.8), (0, -0.4), (0, 0.0), (1, -0.4), (1, 0.0), (5, 1000.0)]


def crowd():
    """Track 9 is annotated at ticks 0 to 6, track 4 at 1 to 5, 0.4 ms late, and track 7 at 2 to 4."""
    track, tick = np.array(
        [(9, k) for k in range(7)] + [(4, k) for k in range(1, 6)] + [(7, 2), (7, 3), (7, 4)]
    ).T
    late_s = np.where(track == 4, 4e-4, 0.0)
    rows = np.random.default_rng(0).permutation(len(track))
    return Scene(
        "square", Trajectories(0.4 * tick + late_s, track, place(track, tick)).select(rows), empty_map(), 0.4
    )


def place(track, tick):
    return np.stack([0.5 * tick - track, 0.1 * tick**2 + 0.3 * track], axis=-1)


HOW = Perception(KalmanSettings(acceleration_noise=0.05, position_noise_m=0.05), 0.2)
THREE_AND_TWO = WindowSettings(observed_steps=3, predicted_steps=2, step_s=0.4)


def test_windows_are_all_stretches_of_one_person():
    """Of track 4 one that ends at tick 3, of track 9 three that end at ticks 2, 3 and 4.

    These three ticks are the recordings i = 0, 1, 2, each of which ends at 1000 i seconds. The k-th of the
    three people is 3 i + k there.
    """
    found = find_observed_windows(crowd(), HOW, THREE_AND_TWO)
    track, tick = np.array([4, 9, 9, 9]), np.array([3, 2, 3, 4])
    np.testing.assert_array_equal(found.track, track)
    np.testing.assert_allclose(found.time_s, 0.4 * tick + np.array([4e-4, 0, 0, 0]))
    truth = place(track[:, None], tick[:, None] + np.array([1, 2]))
    np.testing.assert_allclose(found.truth, truth)
    asked = found.request.asked
    assert asked.track_id.tolist() == [3, 2, 5, 8]
    assert asked.time_s.tolist() == [1000.0, 0.0, 1000.0, 2000.0]
    np.testing.assert_allclose(integrate_truth(asked, 0.4), truth, atol=1e-5)


def test_training_rows_come_in_stretches_of_equal_time():
    """Three from 0.8 to 1.6 s: windows that end at 0.8 s, at 1.2 and 1.2004 s, and at 1.6 s."""

    class Positions:
        def compute(self, seen, dt_s):
            return {"position": seen.observers.position}

    windows = find_observed_windows(crowd(), HOW, THREE_AND_TWO)
    parts = list(training_rows(windows, Positions(), 3))
    for part, rows in zip(parts, ([1], [2, 0], [3]), strict=True):
        np.testing.assert_array_equal(part["future"], windows.request.asked.future[rows])
        np.testing.assert_allclose(part["position"], windows.request.asked.position[rows])


def test_stretches_follow_each_other_at_the_step():
    """Within 1 ms; 0.40105 s are another step. Rows are in the order of tracks and time."""
    people = Trajectories(TIME_S, TRACK, PLACE)
    rows = consecutive_rows(people, 3, 0.4)
    assert people.time_s[rows].tolist() == [[0.0, 0.4, 0.8], [0.4, 0.8, 1.2]]
    assert (people.track_id[rows] == 7).all()
    pairs = consecutive_rows(people, 2, 0.4009)
    assert people.track_id[pairs].tolist() == [[7, 7]] * 3 + [[9, 9]]
    assert len(consecutive_rows(people, 2, 0.40105)) == 0
    assert consecutive_rows(people, 7, 0.4).shape == (0, 7)


def test_the_best_of_the_first_modes_counts():
    """Errors 1, 1, 6 | 4, 0.5, 1.5 m; ADE 8/3 and 2 m, FDE 6 and 1.5 m. The third mode does not count."""
    truth = np.array([[[3.0, -1.0], [4.0, 2.0], [5.0, 7.0]]])
    error_m = np.array([[1, 1, 6], [4, 0.5, 1.5], [0, 0, 0]])
    path = truth[:, None] + error_m[None, ..., None] * [0.6, -0.8]
    modes = Predictions(path[:, 2], path, np.array([[0.5, 0.3, 0.2]]), 0.4)
    found = best_of(modes, truth, 2)
    np.testing.assert_allclose([found[BEST_ADE], found[BEST_FDE]], [[2.0], [1.5]])
    single = best_of(Predictions.single(path[:, 0], 0.4), truth, 2)
    assert np.isnan([single[BEST_ADE], single[BEST_FDE]]).all()
