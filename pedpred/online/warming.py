"""Compiling beforehand whatever a robot or the command `pedpred` can need, so that no frame waits for it."""

from __future__ import annotations

import logging
import time
from pathlib import Path

import numpy as np

from pedpred.compiled import cache_folder
from pedpred.evaluation import EvaluationSettings
from pedpred.evaluation.windows import ask_about_windows
from pedpred.features.perception import Perception
from pedpred.models.features import FEATURES
from pedpred.online.assessment import assess
from pedpred.online.predictor import OnlinePredictor
from pedpred.online.replay import replay_scene
from pedpred.scenes import OccupancyMap, Scene, Trajectories

_LOG = logging.getLogger(__name__)
_FRAMES, _DT_S = 70, 0.1
_SPEEDS_MPS = np.array([[1.2, 0.0], [-1.2, 0.05], [0.0, 0.0]])
_PLACES_M = np.array([[-4.0, 0.0], [4.0, -0.2], [0.0, 1.0]])
_ALONE = 10  # frames in which only the first person is there


def warm_up(model: Path | str | None = None) -> None:
    """Compile the loops that updates, `pedpred predict` and `pedpred evaluate` call, unless they are kept.

    Takes some seconds once; the log says where compiled code is kept. Afterwards no update of a predictor of
    this process compiles anything, and none of another process that finds the same folder.

    Args:
        model: a model folder; None: the default one. What models of other kinds need is compiled, too.

    Raises:
        StorageError: a file of the model is missing, altered or of another version.
    """
    begun_s = time.monotonic()
    predictor, scene = OnlinePredictor.load(model), _meeting()
    for _ in replay_scene(scene, predictor, true_velocities=False):
        pass
    assess(scene, predictor, EvaluationSettings(bootstrap=1))
    how = Perception(predictor.filters, predictor.description.standstill_mps)
    request = ask_about_windows(scene, how, predictor.protocol, memory=False)
    for features in FEATURES.values():  # of models of other kinds, too
        request.inputs(features(), request.rows, request.table.time_s[request.rows])
    try:
        place = f"kept in {cache_folder()}"
    except RuntimeError:
        place = "not kept: there is no home folder"
    _LOG.info("loops are compiled (%.1f s), %s", time.monotonic() - begun_s, place)


def _meeting() -> Scene:
    """Two people who walk towards each other and one who stands, beside a wall."""
    frame, person = np.divmod(np.arange(_FRAMES * len(_PLACES_M)), len(_PLACES_M))
    there = (person == 0) | (frame >= _ALONE)
    frame, person = frame[there], person[there]
    time_s = _DT_S * frame
    position = _PLACES_M[person] + time_s[:, None] * _SPEEDS_MPS[person]
    wall = np.zeros((100, 40), bool)
    wall[:, :5] = True
    trajectories = Trajectories(time_s, person, position)
    return Scene("warm-up", trajectories, OccupancyMap(wall, np.array([-5.0, -2.0]), 0.1), _DT_S)
