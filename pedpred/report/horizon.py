"""Error over the prediction horizon, as the paper's figure: a box per method and step."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from pedpred.report.canvas import blank, styled
from pedpred.report.measures import MethodMetrics
from pedpred.report.methods import colours, label, ordered

_OUTLIER = 1.6
"""A method whose last box ends this much above all others' does not set the scale."""


@styled
def horizon_figure(methods: MethodMetrics, title: str, step_s: float = 0.3) -> Figure:
    """Boxes from the lower to the upper quartile with the median, and a line through the means.

    Args:
        methods: measures of one scene with `per_step_m` and its quartiles, m. [P] each
        title: what was evaluated.
        step_s: duration of a prediction step, s.
    """
    figure = blank(11.0, 4.0)
    axes = figure.subplots()
    names = ordered(methods)
    colour = colours(names)
    width = 0.8 * step_s / len(names)
    for rank, name in enumerate(names):
        _draw_method(axes, methods[name], (rank - (len(names) - 1) / 2) * width, width, step_s, colour[name])
    steps = len(methods[names[0]]["per_step_m"])
    top, cut = scale_of(ends_of(methods))
    axes.set(
        xticks=np.arange(1, steps + 1) * step_s,
        xlabel="prediction horizon [s]",
        ylabel="position error [m]",
        ylim=(0.0, top),
        title=title,
    )
    handles = [Patch(color=colour[name], label=_entry(name, methods[name], name == cut)) for name in names]
    title = "box: quartiles, median\nline: mean\nfigures: ADE"
    figure.legend(handles=handles, loc="outside right upper", title=title, alignment="left")
    return figure


def _draw_method(axes: Axes, found: dict, shift: float, width: float, step_s: float, colour: str) -> None:
    middle = np.arange(1, len(found["per_step_m"]) + 1) * step_s + shift
    low, median, high = (np.array(found[f"per_step_q{q}_m"]) for q in (25, 50, 75))
    axes.bar(middle, high - low, 0.88 * width, low, color=colour, alpha=0.35, linewidth=0)
    axes.hlines(median, middle - 0.44 * width, middle + 0.44 * width, color=colour, linewidth=1.6)
    axes.plot(middle, found["per_step_m"], color=colour, linewidth=1.0, marker="o", markersize=2.2)


def _entry(name: str, found: dict, cut: bool) -> str:
    beyond = f"\n(beyond: {found['per_step_m'][-1]:.2f} m at the end)" if cut else ""
    return f"{label(name)}, {found['ade_m']:.3f} m{beyond}"


def ends_of(methods: MethodMetrics) -> dict[str, float]:
    """How high the last box or mean of each method reaches, m."""
    return {name: max(m["per_step_q75_m"][-1], m["per_step_m"][-1]) for name, m in methods.items()}


def scale_of(ends: Mapping[str, float]) -> tuple[float, str | None]:
    """Upper end of an axis for these ends, and the method that is far beyond all others, if there is one."""
    by_size = sorted(ends, key=ends.__getitem__)
    if len(by_size) > 1 and ends[by_size[-1]] > _OUTLIER * ends[by_size[-2]]:
        return 1.15 * ends[by_size[-2]], by_size[-1]
    return 1.08 * ends[by_size[-1]], None
