"""`pedpred evaluate`: measure forecasts of a network and of other programs in scenes."""

from __future__ import annotations

import argparse
import copy
import logging
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from pedpred.baselines.present_motion import STRONGEST
from pedpred.command.conversion import read_given
from pedpred.command.field_protocol import assess_windows, field_table
from pedpred.command.foreign import ForeignForecasts, by_name, read_forecasts
from pedpred.command.prediction import read_tracker, robot_for
from pedpred.command.tables import SHOWN, caution, table, verdict
from pedpred.errors import ValueRuleError
from pedpred.evaluation import EvaluationSettings, Scores, pool_scores, summarise_methods
from pedpred.files import write_json
from pedpred.forecasting import ForecastRequest
from pedpred.metrics import METRICS
from pedpred.online.assessment import ALWAYS, assess
from pedpred.ros import Transform
from pedpred.scenes import Placement, Scene, Trajectories, placement
from pedpred.sources.times import check_clock
from pedpred.tables.names import TrackNames
from pedpred.tracking import KalmanSettings, tune_kalman

_log = logging.getLogger(__name__)
_TUNED_AHEAD_S = 3.2
_PAUSE_S = 10.0  # longer than anybody is remembered

Moved = TypeVar("Moved", Trajectories, ForeignForecasts)
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
    foreign = by_name([read_forecasts(path, given.step_s) for path in given.forecasts], ALWAYS)
    scores: Assessed = {}
    places: dict[str, Placement] = {}
    for path in given.scene:
        one = copy.copy(given)
        one.scene = path
        names = TrackNames()
        scene = read_given(one, names)
        check_clock(path, scene.detection_dt_s)
        if scene.name in scores:
            raise ValueRuleError("name", scene.name, f"{path} is the second scene of that name")
        places[scene.name] = placement(scene.trajectories.position, scene.occupancy)
        theirs = {name: forecasts.of_tracks(names) for name, forecasts in foreign.items()}
        scores[scene.name] = _assessed(scene, given, tracker, settings, theirs)
    if len(scores) > 1:
        _add_pool(scores)
    figures = {name: summarise_methods(own, STRONGEST, settings) for name, own in scores.items()}
    for name, rows in figures.items():
        sys.stdout.write(
            field_table(name, scores[name]) if given.protocol else table(name, rows, scores[name])
        )
    sys.stdout.write(verdict(list(scores.values())[-1], settings))
    sys.stdout.writelines(caution(name, place) for name, place in places.items())
    if given.json is not None:
        write_json(given.json, figures)


def _assessed(
    scene: Scene,
    given: argparse.Namespace,
    tracker: KalmanSettings | str | None,
    settings: EvaluationSettings,
    foreign: Mapping[str, ForeignForecasts],
) -> dict[str, Scores]:
    """Score one scene under the given conditions, without the metrics that do not apply."""
    meaningless = []
    if tracker == "tune":
        tracker = _tuned(scene)
    assert not isinstance(tracker, str)
    if given.no_map:
        meaningless += ["obstacle_share"]
    predictor = robot_for(scene, given.model, tracker)
    if given.transform is not None:  # the people of the scene were moved when it was read
        moved = Transform(*given.transform)
        foreign = {name: own.moved(moved) for name, own in foreign.items()}
    if given.alone:
        apart = Apart.of(scene.trajectories)
        scene = replace(scene, trajectories=apart.moved(scene.trajectories))
        foreign = {name: apart.moved(own) for name, own in foreign.items()}
        meaningless += ["collision_share", "mode_collision_share"]
    if given.protocol:
        found = assess_windows(scene, predictor, given.model is not None, settings, foreign)
    else:
        answered = partial(_answered, foreign) if foreign else None
        metrics = None if given.json else {key: METRICS[key] for key in SHOWN}
        found = assess(scene, predictor, settings, None, foreign, answered, metrics)
    return {
        method: replace(own, values={key: v for key, v in own.values.items() if key not in meaningless})
        for method, own in found.items()
    }


def _answered(foreign: Mapping[str, ForeignForecasts], request: ForecastRequest) -> np.ndarray:
    """Which windows have a forecast in every file. [W] bool.

    Raises:
        SourceError: a file has none.
        ValueRuleError: there is no such window.
    """
    found: np.ndarray = np.logical_and.reduce([own.answered(request) for own in foreign.values()])
    if not found.any():
        raise ValueRuleError("--forecasts", list(foreign), "no window has a forecast in each of the files")
    return found


@dataclass(frozen=True)
class Apart:
    """Time shifts that put tracks one after the other, so that no two people meet.

    Attributes:
        track_id: rising. [T]
        shift_s: of each track, s. [T]
    """

    track_id: np.ndarray
    shift_s: np.ndarray

    @classmethod
    def of(cls, people: Trajectories) -> Apart:
        """Those of the people of a scene."""
        track_id, who = np.unique(people.track_id, return_inverse=True)
        first, last = np.full(len(track_id), np.inf), np.full(len(track_id), -np.inf)
        np.minimum.at(first, who, people.time_s)
        np.maximum.at(last, who, people.time_s)
        return cls(track_id, np.cumsum(last - first + _PAUSE_S) - last)

    def moved(self, whose: Moved) -> Moved:
        """Detections or forecasts at their new times; those of tracks that are not in the scene stay."""
        at = np.searchsorted(self.track_id, whose.track_id).clip(max=len(self.track_id) - 1)
        shift_s = np.where(self.track_id[at] == whose.track_id, self.shift_s[at], 0.0)
        return replace(whose, time_s=whose.time_s + shift_s)


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
    scores[name] = {method: pool_scores([own[method] for own in scores.values()]) for method in methods}
