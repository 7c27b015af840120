"""Calibration of forecasts: expected and observed coverage of their error ellipses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pedpred.forecasting import Methods
from pedpred.metrics.calibration import REGIONS, coverage, radius2, shown_steps, squared_mahalanobis
from pedpred.report.canvas import FAINT, blank, styled
from pedpred.storage.windows import EvaluationWindows

_READING = "below the dashed line: overconfident,\nabove it: underconfident"
_SHARES = np.linspace(0.0, 0.99, 100)
_CORNERS = 40


def with_covariances(windows: Sequence[EvaluationWindows], methods: Methods) -> list[str]:
    """Methods that give covariances, in the order of display."""
    return methods.ordered({name for scene in windows for name in scene.covariances})


@styled
def calibration_figure(windows: Sequence[EvaluationWindows], title: str, methods: Methods) -> Figure:
    """Draw expected and observed coverage, a panel per time ahead, a line per method with covariances."""
    figure = blank(9.6, 2.9)
    names, dt_s = with_covariances(windows, methods), windows[0].dt_s
    distance2 = {name: _distances(windows, name) for name in names}
    panels = shown_steps(distance2[names[0]].shape[1])
    for axes, step in zip(figure.subplots(1, len(panels), sharey=True), panels, strict=True):
        axes.plot([0, 100], [0, 100], color=FAINT, linewidth=1.0, dashes=(4, 2))
        for name in names:
            _draw_line(axes, distance2[name][:, step : step + 1], methods[name].colour)
        axes.set(xlim=(0, 100), ylim=(0, 100), aspect="equal", title=f"{(step + 1) * dt_s:.1f} s ahead")
        axes.set(xlabel="should lie inside [%]", ylabel="lie inside [%]" if step == 0 else "")
    figure.suptitle(f"Error ellipses, {title}", x=0.01, ha="left", fontsize=10)
    handles = [
        Line2D([], [], color=method.colour, marker="o", markersize=4.0, label=method.label)
        for method in map(methods.__getitem__, names)
    ]
    figure.legend(handles=handles, loc="outside right center", title=_READING, alignment="left")
    return figure


def ellipse(centre: np.ndarray, covariance: np.ndarray, share: float) -> np.ndarray:
    """Closed outline of the region that holds a share of a plane Gaussian: [corners, 2] m.

    Centre [2] in m and covariance [2, 2] in m^2 are in the same frame.
    """
    turn = np.linspace(0.0, 2 * np.pi, _CORNERS)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return centre + np.sqrt(radius2(share)) * circle @ np.linalg.cholesky(covariance).T


def _distances(windows: Sequence[EvaluationWindows], name: str) -> np.ndarray:
    """Squared Mahalanobis distances of the truth over all windows. [W, P]."""
    errors = [w.truth - w.predictions[name].most_likely for w in windows]
    parts = [squared_mahalanobis(e, w.covariances[name]) for e, w in zip(errors, windows, strict=True)]
    return np.concatenate(parts)


def _draw_line(axes: Axes, distance2: np.ndarray, colour: str) -> None:
    """Observed over expected coverage, %, with a dot at each region of the tables. distance2: [W, 1]."""
    for shares, style in ((_SHARES, {"linewidth": 1.4}), (REGIONS, {"linestyle": "", "marker": "o"})):
        inside = [100 * coverage(distance2, share)[0] for share in shares]
        axes.plot(100 * np.asarray(shares), inside, color=colour, markersize=4.0, **style)
