"""`pedpred evaluate`: measure forecasts of a network and of other programs in scenes."""

from __future__ import annotations

import argparse
import logging
import sys
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import pandas as pd

from pedpred.baselines.present_motion import STRONGEST
from pedpred.command.field_protocol import assess_windows, protocol_table
from pedpred.command.foreign import ForeignForecasts, has_all_forecasts, read_forecasts
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

_PAUSE_S = 10.0  # longer than any person is remembered
_log = logging.getLogger(__name__)

Timed = TypeVar("Timed", Trajectories, ForeignForecasts)


class _Measured(NamedTuple):
    """A scene: its name, file, scores by method, and how its people lie on the map."""

    name: str
    path: Path
    scores: dict[str, Scores]
    place: Placement


def check_evaluation(arguments: argparse.Namespace) -> None:
    """Check the thresholds and the options about forecasts of other programs; adds `settings`.

    Raises:
        ValueRuleError: forecasts are about several scenes, or there are none; or a threshold is wrong.
    """
    if arguments.forecasts and len(arguments.scene) > 1:
        rule = "give the one scene that they are about"
        raise ValueRuleError("forecasts", str(arguments.forecasts[0]), rule)
    if arguments.step_s is not None and not arguments.forecasts:
        raise ValueRuleError("step_s", arguments.step_s, "it is about a table: --forecasts FILE.csv")
    names = ("moving_mps", "collision_m", "bootstrap", "seed")
    arguments.settings = EvaluationSettings(**{name: getattr(arguments, name) for name in names})


def evaluate(arguments: argparse.Namespace) -> None:
    """Measure a network in scenes and compare it with simple methods."""
    settings: EvaluationSettings = arguments.settings
    each = [_measure(path, arguments, settings) for path in arguments.scene]
    names = _unique_names([(one.name, one.path) for one in each])
    scores = {name: one.scores for name, one in zip(names, each, strict=True)}
    if len(scores) > 1:
        whole = "all" if "all" not in scores else "all scenes"
        methods = each[0].scores
        scores[whole] = {method: pool_scores([one.scores[method] for one in each]) for method in methods}
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


def _measure(path: Path, arguments: argparse.Namespace, settings: EvaluationSettings) -> _Measured:
    """Read and score one recording under the given conditions; metrics that do not apply are NaN."""
    recording = open_recording(path, arguments.options)
    scene = recording.scene
    place = placement(scene.trajectories.position, scene.occupancy)
    called = _unique_names([(file.stem, file) for file in arguments.forecasts], taken=ALWAYS)
    read = (read_forecasts(file, arguments.step_s, recording.names) for file in arguments.forecasts)
    foreign = dict(zip(called, read, strict=True))
    if (transform := arguments.options.transform) is not None:  # the people were moved when they were read
        foreign = {name: forecasts.to_map(transform) for name, forecasts in foreign.items()}
    learns = arguments.trust and not (arguments.alone or arguments.protocol)  # which needs other people
    tracker = None if arguments.tracker is None else read_tracker(arguments.tracker)
    predictor = predictor_for(scene, arguments.model, tracker, learns=learns)
    if arguments.alone:
        shift_s = isolating_shifts(scene.trajectories)
        scene = replace(scene, trajectories=shift_times(scene.trajectories, shift_s))
        foreign = {name: shift_times(forecasts, shift_s) for name, forecasts in foreign.items()}
    if arguments.protocol:
        scores = assess_windows(scene, predictor, arguments.model is not None, settings, foreign)
    else:
        answered = partial(has_all_forecasts, foreign) if foreign else None
        metrics = None if arguments.json else {key: METRICS[key] for key in SHOWN}
        scores = assess(scene, predictor, settings, None, foreign, answered, metrics)
    for measured in scores.values():
        for key in measured.values.keys() & _without_meaning(scene, arguments):
            measured.values[key][:] = np.nan  # in this scene; another one of the pool may have it
    return _Measured(scene.name, path, scores, place)


def _unique_names(named: Sequence[tuple[str, Path]], taken: Collection[str] = ()) -> list[str]:
    """Names of files: one that appears twice, or is taken, is followed by the file's path.

    Raises:
        ValueRuleError: a file is there twice.
    """
    count = Counter([*taken, *(name for name, _ in named)])
    names = [name if count[name] == 1 else f"{name} ({path})" for name, path in named]
    if len(set(names)) < len(names):
        raise ValueRuleError("name", names, "two inputs have the same: give each once")
    return names


def _without_meaning(scene: Scene, arguments: argparse.Namespace) -> set[str]:
    """Metrics that a scene cannot have."""
    obstacles = {"obstacle_share"} if arguments.options.no_map else set()
    same_s = TOLERANCE_S if arguments.protocol else SAME_INSTANT_S
    if (np.diff(np.sort(scene.trajectories.time_s)) > same_s).all():  # no two people at one instant
        return obstacles | {"collision_share", "mode_collision_share"}
    return obstacles


def isolating_shifts(people: Trajectories) -> Mapping[int, float]:
    """Time shifts that put tracks one after the other, so that each person is alone: track -> s."""
    spans = pd.Series(people.time_s).groupby(people.track_id).agg(["min", "max"])
    lasting = spans["max"] - spans["min"] + _PAUSE_S
    return (lasting.cumsum() - spans["max"]).to_dict()


def shift_times(timed: Timed, shift_s: Mapping[int, float]) -> Timed:
    """Detections or forecasts at later times; those of other tracks stay."""
    shifts = pd.Series(timed.track_id).map(shift_s).fillna(0.0).to_numpy()
    return replace(timed, time_s=timed.time_s + shifts)
