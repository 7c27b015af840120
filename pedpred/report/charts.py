"""Marks of the page's plots in pixels of their drawing; the templates turn them into SVG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from pedpred.report.measures import Figures
from pedpred.report.methods import Methods

_BOXES = (800.0, 300.0)
_TICKS = MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10])
_OUTLIER = 1.6
"""A method whose last box ends this much above all others' does not set the scale."""


@dataclass(frozen=True)
class Box:
    """One method at one step: the quartiles as a box, the median across it, the mean as a dot, px."""

    left: float
    width: float
    top: float
    bottom: float
    median: float
    mean: float
    tip: str
    figures: str  # mean, and quartiles with the median between them, m

    @property
    def middle(self) -> float:
        """Position of the dot, px from the left."""
        return self.left + self.width / 2


@dataclass(frozen=True)
class BoxPlot:
    """Error over the horizon: a box per method and step; `beyond` says which method leaves the frame."""

    title: str
    width: float  # px
    height: float
    x_ticks: Sequence[tuple[float, str]]  # px, label
    y_ticks: Sequence[tuple[float, str]]
    boxes: Mapping[str, Sequence[Box]]
    labels: Mapping[str, str]  # of the methods
    beyond: str


@dataclass(frozen=True)
class Whisker:
    """A mean with its interval on a scale of 0 to 100; `beyond` the scale an arrow is drawn."""

    low: float
    middle: float
    high: float
    beyond: bool = field(kw_only=True)


def whiskers(figures: Figures) -> dict[str, Whisker]:
    """The ADE of each method with its interval, on the scale that all but outliers share."""
    top, _ = scale_of({name: metrics["ade_m_ci95"][1] for name, metrics in figures.items()})
    shown = {}
    for name, metrics in figures.items():
        low, high = metrics["ade_m_ci95"]
        scaled = [100.0 * value / top for value in (low, metrics["ade_m"], high)]
        shown[name] = Whisker(*scaled, beyond=low > top)
    return shown


def ends_of(figures: Figures) -> dict[str, float]:
    """Upper end of the last box or mean of each method, m."""
    return {
        name: max(metrics["per_step_q75_m"][-1], metrics["per_step_m"][-1])
        for name, metrics in figures.items()
    }


def scale_of(ends: Mapping[str, float]) -> tuple[float, str | None]:
    """Upper end of an axis for these ends, and the method that is far beyond all others, if there is one.

    Above exact forecasts nothing is far beyond; if all are exact, the axis ends at 1.
    """
    by_size = sorted(ends, key=ends.__getitem__)
    if len(by_size) > 1 and ends[by_size[-2]] and ends[by_size[-1]] > _OUTLIER * ends[by_size[-2]]:
        return 1.15 * ends[by_size[-2]], by_size[-1]
    return 1.08 * ends[by_size[-1]] or 1.0, None


def box_plot(figures: Figures, title: str, dt_s: float, methods: Methods) -> BoxPlot:
    """The paper's figure: quartiles, median and mean of the error at every step, `dt_s` apart."""
    names = methods.ordered(figures)
    steps = len(figures[names[0]]["per_step_m"])
    top, cut = scale_of(ends_of(figures))
    width, height = _BOXES
    slot = width / steps
    x_ticks = [(round(slot * (k + 0.5), 1), f"{(k + 1) * dt_s:.1f}") for k in range(steps)]
    levels = [tick for tick in _TICKS.tick_values(0.0, top) if tick <= top]
    y_ticks = [(round(height * (1 - tick / top), 1), f"{tick:g}") for tick in levels]
    wide = 0.8 * slot / len(names)
    boxes = {}
    for rank, name in enumerate(names):
        lefts = slot * (np.arange(steps) + 0.1) + rank * wide
        boxes[name] = _boxes(methods[name].label, figures[name], lefts, 0.88 * wide, top, dt_s)
    labels = {name: methods[name].label for name in names}
    return BoxPlot(title, width, height, x_ticks, y_ticks, boxes, labels, labels[cut] if cut else "")


def _boxes(
    label: str, metrics: Mapping[str, Any], lefts: np.ndarray, width: float, top: float, dt_s: float
) -> list[Box]:
    """The boxes of one method; heights are cut at the frame's upper edge."""
    columns = [metrics[f"per_step_{q}m"] for q in ("q25_", "q50_", "q75_", "")]
    boxes = []
    for k, (low, median, high, mean) in enumerate(zip(*columns, strict=True)):
        bottom, middle, upper, dot = (round(_BOXES[1] * (1 - v / top), 1) for v in (low, median, high, mean))
        tip = (
            f"{label} at {(k + 1) * dt_s:.1f} s: mean {mean:.3f} m, median {median:.3f} m, "
            f"quartiles {low:.3f} and {high:.3f} m"
        )
        figures = f"{mean:.3f} ({low:.3f}, {median:.3f}, {high:.3f})"
        boxes.append(Box(round(lefts[k], 1), round(width, 1), upper, bottom, middle, dot, tip, figures))
    return boxes
