"""Training curves: loss and validation error over the steps (or epochs) of training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pedpred.errors import StorageError
from pedpred.files import translate_errors
from pedpred.forecasting import Methods
from pedpred.report.canvas import INK, blank, styled

MEASURES = {
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
    with translate_errors(partial(StorageError, path, "file")):
        curve = pd.read_csv(path, sep="\t")
    if "epoch" not in curve:
        raise StorageError(path, "column epoch", "it is missing")
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
        stage: {key: own[key] for key in [*[""] * ("" in own), *methods.ordered(own.keys() - {""})]}
        for stage, own in stages.items()
    }


def choose_score(columns: Sequence[str]) -> str:
    """The score of a training that is shown: a known one, else the first that it was validated by."""
    scores = [name for name in columns if name.startswith("validation_") and not name.endswith("_loss")]
    return next((name for name in MEASURES if name in scores), scores[0])


@styled
def curves_figure(curves: Mapping[str, pd.DataFrame], methods: Methods) -> Figure:
    """Draw a column per stage of training, a row per kind of figure, a line per network."""
    stages = by_stage(curves, methods)
    figure = blank(max(4.0, 2.6 * len(stages)), 4.6)
    grid = figure.subplots(2, len(stages), squeeze=False)
    for column, (stage, by_network) in enumerate(stages.items()):
        columns = list(dict.fromkeys(str(name) for curve in by_network.values() for name in curve))
        losses = [name for name in columns if name.endswith("_loss")]
        scores = [choose_score(columns)]
        grid[0, column].set_title(stage)
        for axes, shown in ((grid[0, column], losses), (grid[1, column], scores)):
            _draw(axes, by_network, shown, methods)
        stepped = all("step" in curve for curve in by_network.values())
        grid[1, column].set_xlabel("step" if stepped else "epoch")
    return figure


def _draw(axes: Axes, by_network: Mapping[str, pd.DataFrame], measures: list[str], methods: Methods) -> None:
    """Lines of one panel: the network gives the colour, a second measure is dashed."""
    for network, curve in by_network.items():
        for rank, measure in enumerate(m for m in measures if m in curve):
            tone = methods[network].colour if network else INK
            name = methods[network].label if network and rank == 0 else None
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
    axes.set_ylabel(" / ".join(MEASURES.get(measure, measure) for measure in measures))
    axes.margins(x=0.03)
    if any(by_network):
        axes.legend()
