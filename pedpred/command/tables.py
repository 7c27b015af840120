"""Figures of `pedpred evaluate` as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pedpred.baselines.present_motion import PRESENT_MOTION, STRONGEST
from pedpred.evaluation import EvaluationSettings, Scores, summarise_methods
from pedpred.metrics import METRICS
from pedpred.scenes import Placement

SHOWN = ("ade_m", "fde_m", "moving_ade_m", "standing_ade_m", "nll", "obstacle_share", "collision_share")
"""Metrics in the table, in its order."""
_MANY_TRACKS = 10
_NOISY = 2.0
"""Constant velocity errs more than the Kalman filter by this factor where steps are noise."""

Rows = Mapping[str, Mapping[str, Any]]
"""Method -> figure -> value."""


def metric_table(name: str, rows: Rows, scores: Mapping[str, Scores]) -> str:
    """Write the figures of a scene: a row per method.

    Args:
        name: of the scene.
        rows: its figures.
        scores: of the same methods.
    """
    some, measured = next(iter(rows.values())), next(iter(scores.values()))
    first, *others = SHOWN
    titles = [f"{METRICS[key].label} {METRICS[key].unit}" for key in SHOWN]
    cells: list[Sequence[str]] = [("method", titles[0], "95 % interval", *titles[1:])]
    for method, row in rows.items():
        has_interval = row["tracks"] > 1  # bootstrap replicates of a single track are all the same
        interval = " - ".join(_cell(first, end) for end in row[f"{first}_ci95"]) if has_interval else "-"
        cells.append((method, _cell(first, row[first]), interval, *(_cell(k, row.get(k)) for k in others)))
    moving = int(np.isfinite(measured.values["moving_ade_m"]).sum())
    split = f"{moving} of people who move, {some['windows'] - moving} of people who stand"
    lost = some["eligible"] - some["windows"]
    without = f"; {lost} more without truth" if lost else ""
    about = f"{name}: {some['windows']} windows of {some['tracks']} tracks ({split}{without})"
    return align_columns(about, cells)


def align_columns(about: str, cells: Sequence[Sequence[str]]) -> str:
    """Write a line about a table, and its rows with columns of equal width."""
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  ".join(cell.rjust(w) for cell, w in zip(line, widths, strict=True)) for line in cells]
    return "\n".join([about, *lines, "", ""])


def note_on_map(name: str, place: Placement) -> str:
    """A warning that the map of a scene is probably misplaced; empty for others."""
    if not place.wrong:
        return ""
    return f"{name}: WRONG MAP? {place}: figures with this map say little; look at both, or use --no-map\n"


def note_on_noise(name: str, rows: Rows) -> str:
    """A note that simple methods continue the noise of detections; empty where they do not."""
    if rows["cv"]["ade_m"] <= _NOISY * rows["kalman_cv"]["ade_m"]:
        return ""
    return (
        f"{name}: cv and ca continue the noise of single steps; kalman_cv smooths it: compare with that one\n"
    )


def note_on_intervals(tracks: int) -> str:
    """A note that intervals over few tracks are too narrow; empty over many, and over one, which has none.

    The coverage holds for tracks whose errors are normally distributed.
    """
    if not 1 < tracks < _MANY_TRACKS:
        return ""
    return (
        f"95 % intervals over {tracks} tracks are too narrow: over 2, 3, 5 and 10 tracks, they hold the true "
        "mean in about 51, 72, 80 and 87 % of cases"
    )


def _cell(key: str, value: float | None) -> str:
    """Write a figure with the digits of its unit."""
    if value is None:
        return "-"
    return f"{100 * value:.1f}" if METRICS[key].unit == "%" else f"{value:.3f}"


def comparisons(scores: Mapping[str, Scores], settings: EvaluationSettings) -> str:
    """Compare the ADE of every other method with that of the best simple one, a line each.

    Args:
        scores: by method, in the same windows.
        settings: of the bootstrap.
    """
    best = min(PRESENT_MOTION, key=lambda method: float(scores[method].values["ade_m"].mean()))
    others = [method for method in scores if method not in PRESENT_MOTION]
    rows = summarise_methods({method: scores[method] for method in (best, *others)}, best, settings)
    return "".join(_comparison(method, best, rows[method], rows[best]["ade_m"]) for method in others)


def _comparison(method: str, best: str, row: Mapping[str, Any], reference_m: float) -> str:
    difference = row["ade_m_minus_reference"]
    low, high = row["ade_m_minus_reference_ci95"]
    interval = "no interval over a single track"
    if row["tracks"] > 1:
        interval = f"95 % interval {_cell('ade_m', low)} to {_cell('ade_m', high)}"
    verdict = f"{'better' if difference < 0 else 'worse'} than {best}"
    if low is None or low <= 0 <= high:
        verdict = f"no clear difference from {best}"
    relative = f", {100 * difference / reference_m:+.0f} %" if reference_m else ""
    fitted = ", fitted to this recording" if best == STRONGEST else ""
    best_of = f"the best simple method{fitted}"
    return f"{method}: {verdict}, {best_of}: ADE {difference:+.3f} m{relative} ({interval})\n"
