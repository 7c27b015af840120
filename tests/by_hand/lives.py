"""Two lives of one track and one of another, tracked beside where they are seen, for values by hand."""

import numpy as np

from pedpred.scenes import Scene, Trajectories
from pedpred.tracking import Tracks
from tests.worlds import empty_map

TIME_S = np.array([1.0, 1.4, 1.8, 2.3, 5.0, 5.3, 0.9, 1.02])
TRACK, AGE = np.array([4, 4, 4, 4, 4, 4, 7, 7]), np.array([0, 1, 2, 3, 0, 1, 0, 1])
SEEN = np.array([[0, 1], [0.4, 1.2], [1.0, 1.1], [1.3, 1.9], [6, 6], [6.3, 5.7], [3, 3], [3.06, 2.7]], float)
TRACKED = SEEN + np.array([0.03, -0.02]) * np.arange(1, 9)[:, None]
PACE = np.array([[0, 0], [0.9, 0.4], [1.1, 0.3], [0.8, 1.0], [0, 0], [0.7, -0.9], [0, 0], [0.4, -1.2]], float)
HEADING = np.array([0.0, 0.4, 0.3, 0.9, 0.0, -0.9, 0.0, -1.2])


def tracks_of(**given):
    """Track 4 with lives of four and two detections, track 7 with two; tracked beside the detections."""
    usual = {"track_id": TRACK, "person_id": TRACK, "life": np.array([0] * 4 + [1] * 2 + [2] * 2)}
    usual |= {"time_s": TIME_S, "age": AGE, "detection": SEEN, "position": TRACKED, "velocity": PACE}
    usual |= {"covariance": np.outer(np.arange(1.0, 9.0), [1.0, 0.1, 2.0]), "heading_rad": HEADING}
    return Tracks(**usual | given)


def scene_of(detection_dt_s=0.4):
    return Scene("hand", Trajectories(TIME_S, TRACK, SEEN), empty_map(), detection_dt_s)
