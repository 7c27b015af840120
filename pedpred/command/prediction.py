"""`pedpred predict` and `pedpred evaluate`: record or measure the forecasts of a network in scenes."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from pedpred.baselines.present_motion import STRONGEST
from pedpred.command.conversion import layout_of, read_any, refuse_overwriting
from pedpred.errors import ValueRuleError
from pedpred.evaluation import EvaluationSettings, Scores, pooled, summaries
from pedpred.files import write_json
from pedpred.metrics import METRICS
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.assessment import assess
from pedpred.online.replay import as_windows, replayed
from pedpred.ros import check_recordable, write_recording
from pedpred.ros.foxglove import write_layout
from pedpred.scenes import Forecast, Scene

_log = logging.getLogger(__name__)
_METHOD = "pedpred"
_COLOUR = (0.84, 0.37, 0.0)
_SHOWN = ("ade_m", "fde_m", "moving_ade_m", "nll", "obstacle_share", "collision_share")


def predict(given: argparse.Namespace) -> None:
    """Replay a scene frame by frame and write it with the forecasts as MCAP."""
    output = given.output or Path(f"{given.scene.stem}_forecasts.mcap")
    if output.suffix != ".mcap":
        raise ValueRuleError("output", str(output), "the name of a recording ends in .mcap")
    refuse_overwriting(output, given.force)
    scene = read_any(given.scene)
    predictor = robot_for(scene, given.model)
    check_recordable(scene, predictor.features.horizon_steps, given.grid)
    windows = as_windows(scene, with_progress(scene, predictor), _METHOD, predictor.features)
    write_recording(scene, output, windows, {_METHOD: _COLOUR}, planned=_METHOD, cell_m=given.grid)
    write_layout(scene.occupancy, set(), layout_of(output))
    _log.info("%s: recorded with forecasts in %s", scene.name, output)


def robot_for(scene: Scene, model: Path | None) -> OnlinePredictor:
    """Load a predictor that does not drop people between two detections of this scene; None: default."""
    return OnlinePredictor.load(model, OnlineSettings(max_age_s=max(0.5, 1.25 * scene.detection_dt_s)))


def with_progress(scene: Scene, predictor: OnlinePredictor) -> Iterator[Forecast]:
    """Yield the forecasts of a replay, with a progress bar."""
    frames = len(np.unique(scene.trajectories.time_s))
    yield from tqdm(replayed(scene, predictor), total=frames, desc=f"replay {scene.name}", unit="frame")


def evaluate(given: argparse.Namespace) -> None:
    """Measure a network in scenes and compare it with simple methods."""
    settings = EvaluationSettings(
        given.moving_mps, given.collision_m, bootstrap=given.samples, seed=given.seed
    )
    scores: dict[str, dict[str, Scores]] = {}
    for path in given.scene:
        scene = read_any(path)
        if scene.name in scores:
            raise ValueRuleError("name", scene.name, f"{path} is the second scene of that name")
        predictor = robot_for(scene, given.model)
        scores[scene.name] = assess(scene, predictor, with_progress(scene, predictor), settings)
    if len(scores) > 1:
        methods = next(iter(scores.values()))
        scores["all"] = {m: pooled([own[m] for own in scores.values()]) for m in methods}
    figures = {name: summaries(own, STRONGEST, settings) for name, own in scores.items()}
    for name, rows in figures.items():
        sys.stdout.write(_table(name, rows))
    if given.json is not None:
        write_json(given.json, figures)


def _table(name: str, rows: Mapping[str, Mapping[str, Any]]) -> str:
    """Write the figures of a scene as a table."""
    some = next(iter(rows.values()))
    first, *others = _SHOWN
    titles = [f"{METRICS[key].label} {METRICS[key].unit}" for key in _SHOWN]
    cells: list[Sequence[str]] = [("method", titles[0], "95 % interval", *titles[1:])]
    for method, row in rows.items():
        interval = " - ".join(_cell(first, end) for end in row[f"{first}_ci95"])
        cells.append((method, _cell(first, row[first]), interval, *(_cell(k, row.get(k)) for k in others)))
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  ".join(cell.rjust(w) for cell, w in zip(line, widths, strict=True)) for line in cells]
    lost = some["eligible"] - some["windows"]
    without = f", {lost} more without truth" if lost else ""
    return "\n".join(
        [f"{name}: {some['windows']} windows of {some['tracks']} tracks{without}", *lines, "", ""]
    )


def _cell(key: str, value: float | None) -> str:
    """Write a figure with the digits of its unit."""
    if value is None:
        return "-"
    return f"{100 * value:.1f}" if METRICS[key].unit == "%" else f"{value:.3f}"
