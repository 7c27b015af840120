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
from pedpred.command.foreign import (
    ForeignForecasts,
    answered_by_all,
    names_of_files,
    read_forecasts,
    steps_of_tables,
)
from pedpred.command.prediction import read_tracker, robot_for
from pedpred.command.tables import SHOWN, caution, doubt_intervals, remark, table, verdict
from pedpred.evaluation import EvaluationSettings, Scores, pool_scores, summarise_methods
from pedpred.files import write_json
from pedpred.literature.stretches import TOLERANCE_S
from pedpred.metrics import METRICS
from pedpred.metrics.paths import SAME_INSTANT_S
from pedpred.online.assessment import ALWAYS, assess
from pedpred.reading.checks import check_interval
from pedpred.reading.errors import add_path
from pedpred.reading.names import TrackNames
from pedpred.ros import Transform
from pedpred.scenes import Placement, Scene, Trajectories, placement
from pedpred.tracking import KalmanSettings, tune_kalman

_log = logging.getLogger(__name__)
_TUNED_AHEAD_S = 3.2
_PAUSE_S = 10.0  # longer than anybody is remembered

Moved = TypeVar("Moved", Trajectories, ForeignForecasts)
Assessed = dict[str, dict[str, Scores]]
"""Scene -> method -> scores."""


def evaluate(arguments: argparse.Namespace) -> None:
    """Measure a network in scenes and compare it with simple methods."""
    settings = EvaluationSettings(
        moving_mps=arguments.moving_mps,
        collision_m=arguments.collision_m,
        bootstrap=arguments.samples,
        seed=arguments.seed,
    )
    tracker = read_tracker(arguments.tracker) if isinstance(arguments.tracker, Path) else arguments.tracker
    steps_s = steps_of_tables(arguments.forecasts, arguments.step_s)
    others = [read_forecasts(path, steps_s.get(path)) for path in arguments.forecasts]
    names_of_others = names_of_files([(one.source.stem, one.source) for one in others], taken=ALWAYS)
    foreign = dict(zip(names_of_others, others, strict=True))
    each: list[tuple[str, Path, dict[str, Scores], Placement]] = []
    for path in arguments.scene:
        one = copy.copy(arguments)
        one.scene = path
        names = TrackNames()
        scene = read_given(one, names)
        with add_path(path):
            check_interval(scene.detection_dt_s)
        place = placement(scene.trajectories.position, scene.occupancy)
        theirs = {name: forecasts.of_tracks(names) for name, forecasts in foreign.items()}
        each.append((scene.name, path, _assessed(scene, arguments, tracker, settings, theirs), place))
    called = names_of_files([(name, path) for name, path, *_ in each])
    scores: Assessed = {name: one[2] for name, one in zip(called, each, strict=True)}
    places = {name: one[3] for name, one in zip(called, each, strict=True)}
    if len(scores) > 1:
        _add_pool(scores)
    figures = {name: summarise_methods(recorded, STRONGEST, settings) for name, recorded in scores.items()}
    for name, rows in figures.items():
        sys.stdout.write(
            field_table(name, scores[name]) if arguments.protocol else table(name, rows, scores[name])
        )
    sys.stdout.write(verdict(list(scores.values())[-1], settings))
    sys.stdout.writelines(remark(name, rows) for name, rows in figures.items())
    for name, recorded in scores.items():
        if doubt := doubt_intervals(len(np.unique(next(iter(recorded.values())).track))):
            _log.warning("%s: %s", name, doubt)
    sys.stdout.writelines(caution(name, place) for name, place in places.items())
    if arguments.json is not None:
        write_json(arguments.json, figures)


def _assessed(
    scene: Scene,
    arguments: argparse.Namespace,
    tracker: KalmanSettings | str | None,
    settings: EvaluationSettings,
    foreign: Mapping[str, ForeignForecasts],
) -> dict[str, Scores]:
    """Score one scene under the given conditions; metrics that do not apply are NaN."""
    meaningless: set[str] = set()
    if tracker == "tune":
        tracker = _tuned(scene)
    assert not isinstance(tracker, str)
    if arguments.no_map:
        meaningless.add("obstacle_share")
    by_itself = arguments.alone or arguments.protocol is not None  # then nothing is known of others
    trust = arguments.trust and not by_itself
    predictor = robot_for(scene, arguments.model, tracker, learn_trust=trust)
    if arguments.transform is not None:  # the people of the scene were moved when it was read
        moved = Transform(*arguments.transform)
        foreign = {name: forecasts.moved(moved) for name, forecasts in foreign.items()}
    if arguments.alone:
        apart = Apart.of(scene.trajectories)
        scene = replace(scene, trajectories=apart.moved(scene.trajectories))
        foreign = {name: apart.moved(forecasts) for name, forecasts in foreign.items()}
    same_s = TOLERANCE_S if arguments.protocol else SAME_INSTANT_S
    if (np.diff(np.sort(scene.trajectories.time_s)) > same_s).all():  # no two people at one instant
        meaningless |= {"collision_share", "mode_collision_share"}
    if arguments.protocol:
        assessed = assess_windows(scene, predictor, arguments.model is not None, settings, foreign)
    else:
        answered = partial(answered_by_all, foreign) if foreign else None
        metrics = None if arguments.json else {key: METRICS[key] for key in SHOWN}
        assessed = assess(scene, predictor, settings, None, foreign, answered, metrics)
    for measured in assessed.values():
        for key in measured.values.keys() & meaningless:
            measured.values[key][:] = np.nan  # in this scene; another one of the pool may have it
    return assessed


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
    fitted = tune_kalman(scene.trajectories, ahead)
    values = ", ".join(f"{name}: {value:.4f}" for name, value in vars(fitted).items())
    _log.info("%s: tracker fitted to this recording itself: {%s}", scene.name, values)
    return fitted


def _add_pool(scores: Assessed) -> None:
    """Add all scenes together, under a name that no scene has."""
    name = "all"
    while name in scores:
        name += " scenes"
    methods = next(iter(scores.values()))
    scores[name] = {method: pool_scores([place[method] for place in scores.values()]) for method in methods}
