"""Regions that hold a share of the probability of a forecast position."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from pedpred.metrics.calibration import negative_log_likelihood, radius2, squared_mahalanobis
from pedpred.scenes import Predictions

_CORNERS, _CELLS = 40, 120
_SPREADS = 3.5
"""Standard deviations around each mode in which its region is searched."""


def region_outlines(predictions: Predictions, row: int, step: int, share: float) -> list[np.ndarray]:
    """Closed outlines of the smallest region that holds a share of a forecast position, m. [corners, 2] each.

    An ellipse of a single Gaussian; of several modes, a contour of their density.
    """
    assert predictions.covariance is not None
    centre, covariance, weight = (
        predictions.path[row, :, step],
        predictions.covariance[row, :, step],
        predictions.weight[row],
    )
    if predictions.modes == 1:
        return [ellipse_outline(centre[0], covariance[0], share)]
    reach = _SPREADS * np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    x, y = np.linspace((centre - reach).min(axis=0), (centre + reach).max(axis=0), _CELLS).T
    points = np.stack(np.meshgrid(x, y), axis=-1)
    distance2 = squared_mahalanobis(points[..., None, :] - centre, covariance)
    density = np.exp(-negative_log_likelihood(distance2, covariance)) @ weight
    ranked = np.sort(density, axis=None)[::-1]
    level = ranked[np.searchsorted(np.cumsum(ranked), share * ranked.sum())]
    return list(Figure().subplots().contour(x, y, density, [level]).allsegs[0])


def ellipse_outline(centre: np.ndarray, covariance: np.ndarray, share: float) -> np.ndarray:
    """Closed outline of the region that holds a share of a plane Gaussian: [corners, 2] m.

    Centre [2] in m and covariance [2, 2] in m^2 are in the same frame.
    """
    turn = np.linspace(0.0, 2 * np.pi, _CORNERS)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return centre + np.sqrt(radius2(share)) * circle @ np.linalg.cholesky(covariance).T
