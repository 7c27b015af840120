"""How well forecasters do in somebody's own scenes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from pedpred.command.prediction import robot_for, with_progress
from pedpred.command.scenes import read_any
from pedpred.errors import ValueRuleError
from pedpred.evaluation import Scores, pooled, summary
from pedpred.evaluation.summary import REFERENCE
from pedpred.files import write_json
from pedpred.online.assessment import assess

MOVING_MPS, COLLISION_M = 0.3, 0.2
"""As in the published metrics (conf/evaluation)."""

_COLUMNS = ("method", "ADE m", "95 % interval", "FDE m", "moving ADE m", "in obstacles", "collisions")


def evaluate(given: argparse.Namespace) -> None:
    """Measure a network in scenes, beside forecasts that only continue the present motion."""
    scores: dict[str, dict[str, Scores]] = {}
    for path in given.scene:
        scene = read_any(path)
        if scene.name in scores:
            raise ValueRuleError("name", scene.name, f"{path} is the second scene of that name")
        predictor = robot_for(scene, given.model)
        forecasts = with_progress(scene, predictor)
        scores[scene.name] = assess(scene, predictor, forecasts, given.moving_mps, given.collision_m)
    if len(scores) > 1:
        methods = next(iter(scores.values()))
        scores["all"] = {m: pooled([own[m] for own in scores.values()]) for m in methods}
    figures = {
        name: {m: summary(s, own[REFERENCE], given.samples, given.seed) for m, s in own.items()}
        for name, own in scores.items()
    }
    for name, rows in figures.items():
        sys.stdout.write(_told(name, rows))
    if given.json is not None:
        write_json(given.json, figures)


def _told(name: str, rows: Mapping[str, Mapping[str, Any]]) -> str:
    """A scene's figures as a table."""
    some = next(iter(rows.values()))
    cells: list[Sequence[str]] = [_COLUMNS]
    for method, row in rows.items():
        low, high = row["ade_ci95_m"]
        ade, fde, moving = (f"{row[key]:.3f}" for key in ("ade_m", "fde_m", "moving_ade_m"))
        shares = (f"{100 * row[key]:.1f} %" for key in ("obstacle_share", "collision_share"))
        cells.append((method, ade, f"{low:.3f} - {high:.3f}", fde, moving, *shares))
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  ".join(cell.rjust(w) for cell, w in zip(line, widths, strict=True)) for line in cells]
    return "\n".join([f"{name}: {some['windows']} windows of {some['tracks']} tracks", *lines, "", ""])
