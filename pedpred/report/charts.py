"""Where the marks of the page's plots lie, in pixels of their drawing; the template turns them into SVG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from matplotlib.ticker import MaxNLocator

from pedpred.report.curves import stage_and_model
from pedpred.report.horizon import ends_of, scale_of
from pedpred.report.measures import MethodMetrics
from pedpred.report.methods import label, ordered

_BOXES = (800.0, 300.0)
_LINES = (300.0, 180.0)
_VALIDATION = {"validation_ade_m": "validation ADE [m]", "validation_iou": "validation IoU"}
_TICKS = MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10])


@dataclass(frozen=True)
class Frame:
    """A plotting area of `width` x `height` px with its ticks: (px, label)."""

    width: float
    height: float
    x_ticks: Sequence[tuple[float, str]]
    y_ticks: Sequence[tuple[float, str]]
    x_label: str
    y_label: str


@dataclass(frozen=True)
class Box:
    """One method at one horizon: the quartiles as a box, the median across it, the mean as a dot, px."""

    left: float
    width: float
    top: float
    bottom: float
    median: float
    mean: float
    tip: str

    @property
    def middle(self) -> float:
        """Where the dot stands, px from the left."""
        return self.left + self.width / 2


@dataclass(frozen=True)
class BoxPlot:
    """Error over the horizon: a box per method and step; `beyond` is a method that leaves the frame."""

    title: str
    frame: Frame
    boxes: Mapping[str, Sequence[Box]]
    beyond: str | None


@dataclass(frozen=True)
class LinePlot:
    """Lines of methods: (method or None, points as `x,y x,y ...`, what the line ends at)."""

    title: str
    frame: Frame
    lines: Sequence[tuple[str | None, str, str]]


@dataclass(frozen=True)
class Whisker:
    """A mean with its interval on a scale of 0 to 100; `beyond` it there is an arrow."""

    low: float
    middle: float
    high: float
    beyond: bool = field(kw_only=True)


def whiskers(methods: MethodMetrics) -> dict[str, Whisker]:
    """Average errors with their intervals, on the scale that all but outliers share."""
    top, _ = scale_of({name: found["ade_m_ci95"][1] for name, found in methods.items()})
    found = {}
    for name, measures in methods.items():
        low, high = measures["ade_m_ci95"]
        scaled = [100.0 * value / top for value in (low, measures["ade_m"], high)]
        found[name] = Whisker(*scaled, beyond=low > top)
    return found


def box_plot(methods: MethodMetrics, title: str, step_s: float = 0.3) -> BoxPlot:
    """The paper's figure: quartiles, median and mean of the error at every step of the horizon."""
    names = ordered(methods)
    steps = len(methods[names[0]]["per_step_m"])
    top, cut = scale_of(ends_of(methods))
    width, height = _BOXES
    slot = width / steps
    x_ticks = [(round(slot * (k + 0.5), 1), f"{(k + 1) * step_s:.1f}") for k in range(steps)]
    frame = Frame(width, height, x_ticks, _levels(height, top), "prediction horizon [s]", "error [m]")
    wide = 0.8 * slot / len(names)
    lefts = {name: slot * (np.arange(steps) + 0.1) + rank * wide for rank, name in enumerate(names)}
    boxes = {name: _boxes(name, methods[name], lefts[name], 0.88 * wide, top, step_s) for name in names}
    return BoxPlot(title, frame, boxes, cut)


def _boxes(name: str, found: dict, lefts: np.ndarray, width: float, top: float, step_s: float) -> list[Box]:
    """The boxes of one method; heights are cut at the frame's upper edge."""
    columns = [found[f"per_step_{q}m"] for q in ("q25_", "q50_", "q75_", "")]
    boxes = []
    for k, (low, median, high, mean) in enumerate(zip(*columns, strict=True)):
        bottom, middle, upper, dot = (round(_BOXES[1] * (1 - v / top), 1) for v in (low, median, high, mean))
        tip = (
            f"{label(name)} at {(k + 1) * step_s:.1f} s: mean {mean:.3f} m, median {median:.3f} m, "
            f"half of all between {low:.3f} and {high:.3f} m"
        )
        boxes.append(Box(round(lefts[k], 1), round(width, 1), upper, bottom, middle, dot, tip))
    return boxes


def training_plots(curves: Mapping[str, pd.DataFrame]) -> list[LinePlot]:
    """What validation says during training: a plot per stage, a line per model."""
    stages: dict[str, dict[str | None, pd.DataFrame]] = {}
    for name, curve in curves.items():
        stage, model = stage_and_model(name)
        stages.setdefault(stage, {})[model] = curve
    plots = []
    for stage, by_model in stages.items():
        measure = next(m for m in _VALIDATION if m in next(iter(by_model.values())))
        along = "step" if all("step" in curve for curve in by_model.values()) else "epoch"
        series = {m: (c[along].fillna(0).to_numpy(), c[measure].to_numpy()) for m, c in by_model.items()}
        plots.append(line_plot(stage, series, along, _VALIDATION[measure]))
    return plots


def line_plot(
    title: str, series: Mapping[str | None, tuple[np.ndarray, np.ndarray]], x_label: str, y_label: str
) -> LinePlot:
    """Lines of (x, y) from the origin up; a series without a method's name is drawn in ink."""
    width, height = _LINES
    right = max(float(x.max()) for x, _ in series.values()) or 1.0
    top = 1.05 * max(float(y.max()) for _, y in series.values()) or 1.0
    x_ticks = [(round(width * t / right, 1), f"{t:g}") for t in _TICKS.tick_values(0.0, right) if t <= right]
    lines = []
    for name, (x, y) in series.items():
        points = zip(width * x / right, height * (1 - y / top), strict=True)
        lines.append((name, " ".join(f"{a:.1f},{b:.1f}" for a, b in points), f"{y[-1]:.3f}"))
    return LinePlot(title, Frame(width, height, x_ticks, _levels(height, top), x_label, y_label), lines)


def _levels(height: float, top: float) -> list[tuple[float, str]]:
    """Round values between 0 and the upper end of an axis, and where they stand, px from above."""
    return [
        (round(height * (1 - t / top), 1), f"{t:g}") for t in _TICKS.tick_values(0.0, top) if 0.0 <= t <= top
    ]
