"""Compiling beforehand whatever a robot can need, so that no frame waits for it."""

from __future__ import annotations

import logging
import time
from pathlib import Path

import numpy as np

from pedpred.compiled import cache_folder
from pedpred.forecasting.local_errors import Means
from pedpred.online.predictor import OnlinePredictor
from pedpred.scenes import OccupancyMap, Trajectories, predicted_occupancy
from pedpred.tracking.matching import cheapest_pairs

_LOG = logging.getLogger(__name__)
_FRAMES, _DT_S = 70, 0.1
_SPEEDS_MPS = np.array([[1.2, 0.0], [-1.2, 0.05], [0.0, 0.0]])
_PLACES_M = np.array([[-4.0, 0.0], [4.0, -0.2], [0.0, 1.0]])
_ALONE = 10  # frames in which only the first person is there


def warm_up(model: Path | str | None = None) -> None:
    """Compile the loops that updates with a model call, and those between messages of ROS, unless kept.

    Takes some seconds once; the log says where compiled code is kept. Afterwards no update of a predictor of
    this process compiles anything, and none of another process that finds the same folder. The command
    `pedpred warm-up` also compiles what `pedpred predict` and `pedpred evaluate` call.

    Args:
        model: a model folder; None: the default one.

    Raises:
        InputError: a file of the model is missing, altered or of another version.
    """
    begun_s = time.monotonic()
    predictor, (people, occupancy) = OnlinePredictor.load(model), meeting()
    predictor.set_map(occupancy)
    for now in np.unique(people.time_s):
        rows = people.time_s == now
        forecast = predictor.update(float(now), people.track_id[rows], people.position[rows])
    predicted_occupancy(forecast.predictions, occupancy.free(1.0))
    cheapest_pairs(np.zeros((1, 2)))
    here, steps = np.zeros((1, 2)), predictor.protocol.horizon_steps  # nobody leaves in these seconds
    Means.empty(steps).with_errors(here, here, np.zeros((1, steps, 2)))
    say_where(begun_s)


def say_where(begun_s: float) -> None:
    """Log that loops are compiled since a time of `time.monotonic`, and where they are kept."""
    try:
        place = f"kept in {cache_folder()}"
    except RuntimeError:
        place = "not kept: there is no home folder"
    _LOG.info("loops are compiled (%.1f s), %s", time.monotonic() - begun_s, place)


def meeting() -> tuple[Trajectories, OccupancyMap]:
    """Two people who walk towards each other and one who stands, beside a wall; seen every 0.1 s."""
    frame, person = np.divmod(np.arange(_FRAMES * len(_PLACES_M)), len(_PLACES_M))
    there = (person == 0) | (frame >= _ALONE)
    frame, person = frame[there], person[there]
    time_s = _DT_S * frame
    position = _PLACES_M[person] + time_s[:, None] * _SPEEDS_MPS[person]
    wall = np.zeros((100, 40), bool)
    wall[:, :5] = True
    return Trajectories(time_s, person, position), OccupancyMap(wall, np.array([-5.0, -2.0]), 0.1)
