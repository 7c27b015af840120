"""Short recordings of the last annotations, and errors of the nearest of some paths, by hand."""

import numpy as np

from pedpred.evaluation.measure import BEST_ADE, BEST_FDE, best_of
from pedpred.evaluation.observed import WindowSettings, consecutive_rows, short_recordings
from pedpred.scenes import Predictions, Trajectories

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


def test_stretches_follow_each_other_at_the_step():
    """Within 1 ms; 0.4015 s are another step. Rows are in the order of tracks and time."""
    people = Trajectories(TIME_S, TRACK, PLACE)
    rows = consecutive_rows(people, 3, 0.4)
    assert people.time_s[rows].tolist() == [[0.0, 0.4, 0.8], [0.4, 0.8, 1.2]]
    assert (people.track_id[rows] == 7).all()
    pairs = consecutive_rows(people, 2, 0.4009)
    assert people.track_id[pairs].tolist() == [[7, 7]] * 3 + [[9, 9]]
    assert len(consecutive_rows(people, 2, 0.4015)) == 0


def test_the_best_of_the_first_modes_counts():
    """Errors 1, 5 | 4, 1 | 0, 0 m of three modes of which two count; ADE 3 and 2.5 m, FDE 5 and 1 m."""
    path = np.zeros((1, 3, 2, 2))
    path[0, :, :, 0] = [[1, 5], [4, 1], [0, 0]]
    modes = Predictions(path[:, 2], path, np.array([[0.5, 0.3, 0.2]]), 0.4)
    found = best_of(modes, np.zeros((1, 2, 2)), 2)
    assert (found[BEST_ADE].tolist(), found[BEST_FDE].tolist()) == ([2.5], [1.0])
    single = best_of(Predictions.single(path[:, 0], 0.4), np.zeros((1, 2, 2)), 2)
    assert np.isnan([single[BEST_ADE], single[BEST_FDE]]).all()
