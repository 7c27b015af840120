"""`pedpred evaluate`: measure forecasts of a network and of other programs in scenes."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from pedpred.baselines.present_motion import STRONGEST
from pedpred.command.field_protocol import assess_windows, protocol_table
from pedpred.command.foreign import (
    ForeignForecasts,
    answered_by_all,
    read_forecasts,
    unique_names,
)
from pedpred.command.prediction import predictor_for, read_tracker
from pedpred.command.recordings import open_recording
from pedpred.command.tables import (
    SHOWN,
    comparisons,
    metric_table,
    note_on_intervals,
    note_on_map,
    note_on_noise,
)
from pedpred.errors import ValueRuleError
from pedpred.evaluation import EvaluationSettings, Scores, pool_scores, summarise_methods
from pedpred.evaluation.observed import TOLERANCE_S
from pedpred.files import write_json
from pedpred.metrics import METRICS
from pedpred.metrics.paths import SAME_INSTANT_S
from pedpred.online.assessment import ALWAYS, assess
from pedpred.scenes import Placement, Scene, Trajectories, placement
from pedpred.tracking import KalmanSettings, tune_kalman

TUNE = "tune"
"""Value of `--tracker`: fit the tracker to the recording itself."""
_TUNED_AHEAD_S = 3.2
_PAUSE_S = 10.0  # longer than any person is remembered
_log = logging.getLogger(__name__)

Timed = TypeVar("Timed", Trajectories, ForeignForecasts)
Assessed = dict[str, dict[str, Scores]]
"""Scene -> method -> scores."""


class _Measured(NamedTuple):
    """A scene: its name, file, scores by method, and how its people lie on the map."""

    name: str
    path: Path
    scores: dict[str, Scores]
    place: Placement


def check_evaluation(arguments: argparse.Namespace) -> None:
    """Check the options about forecasts of other programs.

    Raises:
        ValueRuleError: they are about several scenes, or there are none.
    """
    if arguments.forecasts and len(arguments.scene) > 1:
        rule = "give the one scene that they are about"
        raise ValueRuleError("--forecasts", str(arguments.forecasts[0]), rule)
    if arguments.step_s is not None and not arguments.forecasts:
        raise ValueRuleError("--step-s", arguments.step_s, "it is about a table: --forecasts FILE.csv")


def evaluate(arguments: argparse.Namespace) -> None:
    """Measure a network in scenes and compare it with simple methods."""
    settings = EvaluationSettings(
        moving_mps=arguments.moving_mps,
        collision_m=arguments.collision_m,
        bootstrap=arguments.samples,
        seed=arguments.seed,
    )
    tracker = read_tracker(arguments.tracker) if isinstance(arguments.tracker, Path) else arguments.tracker
    called = unique_names([(path.stem, path) for path in arguments.forecasts], taken=ALWAYS)
    foreign = {
        name: read_forecasts(path, arguments.step_s)
        for name, path in zip(called, arguments.forecasts, strict=True)
    }
    each = [_measure(path, arguments, tracker, settings, foreign) for path in arguments.scene]
    names = unique_names([(one.name, one.path) for one in each])
    scores: Assessed = {name: one.scores for name, one in zip(names, each, strict=True)}
    if len(scores) > 1:
        _add_pool(scores)
    figures = {name: summarise_methods(recorded, STRONGEST, settings) for name, recorded in scores.items()}
    for name, rows in figures.items():
        shown = protocol_table if arguments.protocol else partial(metric_table, rows=rows)
        sys.stdout.write(shown(name, scores=scores[name]))
    sys.stdout.write(comparisons(list(scores.values())[-1], settings))
    sys.stdout.writelines(note_on_noise(name, rows) for name, rows in figures.items())
    for name, recorded in scores.items():
        if note := note_on_intervals(len(np.unique(next(iter(recorded.values())).track))):
            _log.warning("%s: %s", name, note)
    sys.stdout.writelines(note_on_map(name, one.place) for name, one in zip(names, each, strict=True))
    if arguments.json is not None:
        write_json(arguments.json, figures)


def _measure(
    path: Path,
    arguments: argparse.Namespace,
    tracker: KalmanSettings | str | None,
    settings: EvaluationSettings,
    foreign: Mapping[str, ForeignForecasts],
) -> _Measured:
    """Read and score one recording under the given conditions; metrics that do not apply are NaN."""
    options = arguments.options
    recording = open_recording(path, options)
    scene = recording.scene
    place = placement(scene.trajectories.position, scene.occupancy)
    foreign = {name: forecasts.of_tracks(recording.names) for name, forecasts in foreign.items()}
    if options.transform is not None:  # the people of the scene were moved when it was read
        foreign = {name: forecasts.moved(options.transform) for name, forecasts in foreign.items()}
    fitted = _tuned(scene) if isinstance(tracker, str) else tracker
    by_itself = arguments.alone or arguments.protocol is not None  # then the other people are unknown
    predictor = predictor_for(scene, arguments.model, fitted, learn_trust=arguments.trust and not by_itself)
    if arguments.alone:
        isolated = IsolatedTracks.of(scene.trajectories)
        scene = replace(scene, trajectories=isolated.shifted(scene.trajectories))
        foreign = {name: isolated.shifted(forecasts) for name, forecasts in foreign.items()}
    if arguments.protocol:
        scores = assess_windows(scene, predictor, arguments.model is not None, settings, foreign)
    else:
        answered = partial(answered_by_all, foreign) if foreign else None
        metrics = None if arguments.json else {key: METRICS[key] for key in SHOWN}
        scores = assess(scene, predictor, settings, None, foreign, answered, metrics)
    for measured in scores.values():
        for key in measured.values.keys() & _without_meaning(scene, arguments):
            measured.values[key][:] = np.nan  # in this scene; another one of the pool may have it
    return _Measured(scene.name, path, scores, place)


def _without_meaning(scene: Scene, arguments: argparse.Namespace) -> set[str]:
    """Metrics that a scene cannot have."""
    obstacles = {"obstacle_share"} if arguments.options.no_map else set()
    same_s = TOLERANCE_S if arguments.protocol else SAME_INSTANT_S
    if (np.diff(np.sort(scene.trajectories.time_s)) > same_s).all():  # no two people at one instant
        return obstacles | {"collision_share", "mode_collision_share"}
    return obstacles


@dataclass(frozen=True)
class IsolatedTracks:
    """Time shifts that put tracks one after the other, so that each person is alone.

    Attributes:
        track_id: rising. [T]
        shift_s: of each track, s. [T]
    """

    track_id: np.ndarray
    shift_s: np.ndarray

    @classmethod
    def of(cls, people: Trajectories) -> IsolatedTracks:
        """Find the shifts of the people of a scene."""
        track_id, row = np.unique(people.track_id, return_inverse=True)
        first, last = np.full(len(track_id), np.inf), np.full(len(track_id), -np.inf)
        np.minimum.at(first, row, people.time_s)
        np.maximum.at(last, row, people.time_s)
        return cls(track_id, np.cumsum(last - first + _PAUSE_S) - last)

    def shifted(self, timed: Timed) -> Timed:
        """Detections or forecasts at their new times; those of tracks that are not in the scene stay."""
        row = np.searchsorted(self.track_id, timed.track_id).clip(max=len(self.track_id) - 1)
        shift_s = np.where(self.track_id[row] == timed.track_id, self.shift_s[row], 0.0)
        return replace(timed, time_s=timed.time_s + shift_s)


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
