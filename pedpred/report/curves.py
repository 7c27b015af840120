"""Training curves: validation scores over the steps (or epochs) of training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from pedpred.errors import InputError
from pedpred.files import translate_errors
from pedpred.report.canvas import INK, blank, styled
from pedpred.report.methods import Methods

_ENTRY = 0.085
"""Height of an entry of the legend, as a share of the axes: curves end below it."""
_SCORES = {"validation_ade_m": "validation ADE [m]", "validation_iou": "validation IoU"}


def read_curve(path: Path) -> pd.DataFrame:
    """Read the curve of one training: a row per validation.

    Raises:
        InputError: the file cannot be read or has no column `epoch`.
    """
    with translate_errors(partial(InputError, path, "file")):
        curve = pd.read_csv(path, sep="\t")
    if "epoch" not in curve:
        raise InputError(path, "column epoch", "it is missing")
    return curve


def by_stage(curves: Mapping[str, pd.DataFrame], methods: Methods) -> dict[str, dict[str, pd.DataFrame]]:
    """Group curves named `<stage>_<network>` or `<stage>`: stage -> key of the network or "" -> curve.

    A phase that only copied its network has a curve without rows, which is left out.
    """
    keys = sorted((method.key for method in methods), key=len, reverse=True)
    stages: dict[str, dict[str, pd.DataFrame]] = {}
    for name, curve in curves.items():
        if curve.empty:
            continue
        network = next((key for key in keys if name.endswith(f"_{key}")), "")
        stage = name.removesuffix(f"_{network}").replace("_", " ")
        stages.setdefault(stage, {})[network] = curve
    return {
        stage: {key: names[key] for key in [*[""] * ("" in names), *methods.ordered(names.keys() - {""})]}
        for stage, names in stages.items()
    }


def choose_score(columns: Sequence[str]) -> str:
    """The score of a training that is shown: a known one, else the first that it was validated by."""
    scores = [name for name in columns if name.startswith("validation_") and not name.endswith("_loss")]
    return next((name for name in _SCORES if name in scores), scores[0])


@styled
def training_figure(curves: Mapping[str, pd.DataFrame], methods: Methods) -> Figure:
    """Draw the validation score of every stage, a line per network; losses differ in meaning."""
    stages = by_stage(curves, methods)
    columns = min(4, len(stages))
    rows = -(-len(stages) // columns)
    figure = blank(2.8 * columns, 2.4 * rows)
    for rank, (stage, by_network) in enumerate(stages.items()):
        axes = figure.add_subplot(rows, columns, rank + 1)
        along = "step" if all("step" in curve for curve in by_network.values()) else "epoch"
        score = choose_score(list(next(iter(by_network.values())).columns))
        for key, curve in by_network.items():
            known = curve[curve[score].notna()] if score in curve else curve[:0]
            if len(known):
                tone, name = (methods[key].colour, f"{methods[key].label}, ") if key else (INK, "")
                label = f"{name}{known[score].iloc[-1]:.3f}"
                axes.plot(known[along].fillna(0), known[score], color=tone, linewidth=1.2, label=label)
        axes.set(title=stage, xlabel=along, ylabel=_SCORES.get(score, score))
        axes.margins(x=0.03)
        if entries := len(axes.lines):  # none where no network was fine-tuned
            low, high = axes.get_ylim()
            axes.set_ylim(low, low + (high - low) / (1 - _ENTRY * (entries + 0.5)))
            axes.legend(fontsize=7, loc="upper right", borderpad=0, borderaxespad=0, labelspacing=0.25)
    return figure
