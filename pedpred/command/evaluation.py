"""`pedpred evaluate`: measure the forecasts of a network, or of anybody, in scenes."""

from __future__ import annotations

import argparse
import copy
import logging
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from pedpred.baselines.present_motion import STRONGEST
from pedpred.command.conversion import read_given
from pedpred.command.foreign import ForeignForecasts, read_forecasts
from pedpred.command.prediction import read_tracker, robot_for
from pedpred.command.tables import SHOWN, table, verdict
from pedpred.errors import ValueRuleError
from pedpred.evaluation import EvaluationSettings, Scores, pooled, summaries
from pedpred.files import write_json
from pedpred.metrics import METRICS
from pedpred.online.assessment import assess
from pedpred.scenes import OccupancyMap, Scene
from pedpred.sources.single_file import check_clock
from pedpred.tracking import KalmanSettings, tune_kalman

_log = logging.getLogger(__name__)
_TUNED_AHEAD_S = 3.2
_PAUSE_S = 10.0  # longer than anybody is remembered

Assessed = dict[str, dict[str, Scores]]
"""Scene -> method -> scores."""


def evaluate(given: argparse.Namespace) -> None:
    """Measure a network in scenes and compare it with simple methods."""
    settings = EvaluationSettings(
        moving_mps=given.moving_mps,
        collision_m=given.collision_m,
        bootstrap=given.samples,
        seed=given.seed,
    )
    tracker = read_tracker(given.tracker) if isinstance(given.tracker, Path) else given.tracker
    foreign = read_forecasts(given.forecasts, given.step_s) if given.forecasts else None
    scores: Assessed = {}
    for path in given.scene:
        one = copy.copy(given)
        one.scene = path
        scene = read_given(one)
        check_clock(path, scene.detection_dt_s)
        if scene.name in scores:
            raise ValueRuleError("name", scene.name, f"{path} is the second scene of that name")
        scores[scene.name] = _assessed(scene, given, tracker, settings, foreign)
    if len(scores) > 1:
        _add_pool(scores)
    figures = {name: summaries(own, STRONGEST, settings) for name, own in scores.items()}
    for name, rows in figures.items():
        sys.stdout.write(table(name, rows, scores[name]))
    sys.stdout.write(verdict(list(scores.values())[-1], settings))
    if given.json is not None:
        write_json(given.json, figures)


def _assessed(
    scene: Scene,
    given: argparse.Namespace,
    tracker: KalmanSettings | str | None,
    settings: EvaluationSettings,
    foreign: ForeignForecasts | None,
) -> dict[str, Scores]:
    """Scores in one scene under the given conditions, without metrics that mean nothing there."""
    meaningless = []
    if tracker == "tune":
        tracker = _tuned(scene)
    assert not isinstance(tracker, str)
    if given.no_map:
        scene = replace(scene, occupancy=OccupancyMap.free_around(scene.trajectories.position))
        meaningless += ["obstacle_share"]
    predictor = robot_for(scene, given.model, tracker)
    if given.alone:
        scene = one_by_one(scene)
        meaningless += ["collision_share", "mode_collision_share"]
    others = {} if foreign is None else {foreign.name: foreign}
    answered = None if foreign is None else foreign.answered
    metrics = None if given.json else {key: METRICS[key] for key in SHOWN}
    found = assess(scene, predictor, settings, None, others, answered, metrics)
    return {
        method: replace(own, values={key: v for key, v in own.values.items() if key not in meaningless})
        for method, own in found.items()
    }


def one_by_one(scene: Scene) -> Scene:
    """Return the scene with one track after the other, so that nobody meets anybody."""
    own = scene.trajectories
    _, who = np.unique(own.track_id, return_inverse=True)
    first, last = np.full(who.max(initial=-1) + 1, np.inf), np.full(who.max(initial=-1) + 1, -np.inf)
    np.minimum.at(first, who, own.time_s)
    np.maximum.at(last, who, own.time_s)
    end = np.cumsum(last - first + _PAUSE_S)
    shift = end - last
    return replace(scene, trajectories=replace(own, time_s=own.time_s + shift[who]))


def _tuned(scene: Scene) -> KalmanSettings:
    """Fit the tracker to the recording that it is used for, which flatters all methods a little."""
    ahead = max(1, round(_TUNED_AHEAD_S / scene.detection_dt_s))
    found = tune_kalman(scene.trajectories, ahead)
    values = ", ".join(f"{name}: {value:.4f}" for name, value in vars(found).items())
    _log.info("%s: tracker fitted to this recording itself: {%s}", scene.name, values)
    return found


def _add_pool(scores: Assessed) -> None:
    """Add all scenes together, under a name that no scene has."""
    name = "all"
    while name in scores:
        name += " scenes"
    methods = next(iter(scores.values()))
    scores[name] = {method: pooled([own[method] for own in scores.values()]) for method in methods}
