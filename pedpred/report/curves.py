"""Training curves: loss and validation error over the steps (or epochs) of training."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pedpred.errors import StorageError
from pedpred.files import translate_errors
from pedpred.report.canvas import INK, blank, styled
from pedpred.report.methods import colours, label

_MODELS = ("lstm_nogrid", "lstm")
_MEASURES = {
    "train_loss": "training loss",
    "validation_loss": "validation (dashed)",
    "validation_ade_m": "validation ADE [m]",
    "validation_iou": "validation IoU",
}


def read_curve(path: Path) -> pd.DataFrame:
    """Read the curve of one training: a row per validation.

    Raises:
        StorageError: the file cannot be read or has no column `epoch`.
    """
    with translate_errors(partial(StorageError, path, "file", remedy="Train again (dvc repro)")):
        curve = pd.read_csv(path, sep="\t")
    if "epoch" not in curve:
        raise StorageError(path, "column epoch", "it is missing", "Train again (dvc repro)")
    return curve


def stage_and_model(name: str) -> tuple[str, str | None]:
    """`main_lstm_nogrid` -> (`main`, `lstm_nogrid`); the model's name may stand anywhere, or nowhere."""
    for model in _MODELS:
        if model in name:
            before, _, after = name.partition(model)
            return " ".join(f"{before} {after}".replace("_", " ").replace("-", " ").split()), model
    return name, None


@styled
def curves_figure(curves: Mapping[str, pd.DataFrame]) -> Figure:
    """A column per stage of training, a row per kind of measure, a line per model."""
    stages: dict[str, dict[str | None, pd.DataFrame]] = {}
    for name in curves:
        stage, model = stage_and_model(name)
        stages.setdefault(stage, {})[model] = curves[name]
    figure = blank(max(4.0, 2.6 * len(stages)), 4.6)
    grid = figure.subplots(2, len(stages), squeeze=False)
    for column, (stage, by_model) in enumerate(stages.items()):
        measures = [m for m in _MEASURES if any(m in curve for curve in by_model.values())]
        losses = [m for m in measures if m.endswith("_loss")]
        scores = [m for m in measures if m not in losses]
        grid[0, column].set_title(stage)
        for axes, shown in ((grid[0, column], losses), (grid[1, column], scores)):
            _draw(axes, by_model, shown)
        stepped = all("step" in curve for curve in by_model.values())
        grid[1, column].set_xlabel("step" if stepped else "epoch")
    return figure


def _draw(axes: Axes, by_model: Mapping[str | None, pd.DataFrame], measures: list[str]) -> None:
    """Lines of one panel: the model gives the colour, a second measure is dashed."""
    colour = colours(name for name in by_model if name)
    for model, curve in by_model.items():
        for rank, measure in enumerate(m for m in measures if m in curve):
            tone = colour[model] if model else INK
            name = label(model) if model and rank == 0 else None
            style: dict[str, Any] = {
                "linestyle": ("-", "--")[rank % 2],
                "marker": "." if len(curve) < 40 else "",
            }
            axes.plot(
                curve.get("step", curve["epoch"]),
                curve[measure],
                color=tone,
                linewidth=1.2,
                label=name,
                **style,
            )
    axes.set_ylabel(" / ".join(_MEASURES[measure] for measure in measures))
    axes.margins(x=0.03)
    if any(by_model):
        axes.legend()
