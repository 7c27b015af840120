"""Fit of social-force parameters to one place: joint rollouts against true paths."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from pedpred.baselines.social_force import InitialState
from pedpred.errors import ShapeError
from pedpred.simulation.settings import SocialForceSettings

FITTED = (
    "relaxation_time_s",
    "pedestrian_strength",
    "pedestrian_range_m",
    "border_strength",
    "border_range_m",
    "group_gaze",
    "group_attraction",
    "group_repulsion",
)
"""Parameters that are fitted; all positive."""

_SPAN = 4.0  # values stay in [start / 4, start * 4], where the terms keep their meaning ...
_GROUP_LEAST = 0.02  # ... but the group terms, which not all people follow, may fall to this share


@dataclass(frozen=True)
class Fit:
    """Result of a fit.

    Attributes:
        forces: fitted values by name.
        start_m: average displacement error with the parameters that the search started from.
        reached_m: the same with the fitted ones.
        trials: how many parameter sets were rolled out.
    """

    forces: dict[str, float]
    start_m: float
    reached_m: float
    trials: int


def fit_forces(
    start: InitialState,
    asked: np.ndarray,
    truth: np.ndarray,
    model: SocialForceSettings,
    dt_s: float,
    most_trials: int,
) -> Fit:
    """Search from the model's own parameters (Nelder & Mead 1965, in logarithms).

    Args:
        start: all people at the instants of the windows, of the *training* place. [W]
        asked: rows of `start` whose error counts. [A]
        truth: their true paths, world frame, m. [A, P, 2]
        model: start values, and all that is not fitted.
        dt_s: time between two steps of the paths, s.
        most_trials: parameter sets to try at most.

    Raises:
        ShapeError: `truth` is not that of `asked`.
    """
    if len(truth) != len(asked):
        raise ShapeError("truth", truth.shape, f"[{len(asked)}, P, 2]")
    first = np.array([getattr(model.forces, name) for name in FITTED])

    def error_m(logarithms: np.ndarray) -> float:
        values = dict(zip(FITTED, np.exp(logarithms).tolist(), strict=True))
        tried = replace(model, forces=model.forces._replace(**values))
        paths = start.paths(tried, truth.shape[1], dt_s)[asked]
        return float(np.linalg.norm(paths - truth, axis=-1).mean())

    low = np.where([name.startswith("group_") for name in FITTED], _GROUP_LEAST, 1.0 / _SPAN)
    found = minimize(
        error_m,
        np.log(first),
        method="Nelder-Mead",
        bounds=np.log(np.stack([first * low, first * _SPAN], axis=1)),
        options={
            "maxfev": most_trials,
            "xatol": 1e-2,
            "fatol": 1e-5,
            "adaptive": True,
            "initial_simplex": _simplex(np.log(first)),
        },
    )
    forces = dict(zip(FITTED, np.exp(found.x).tolist(), strict=True))
    return Fit(forces, error_m(np.log(first)), float(found.fun), int(found.nfev))


def _simplex(center: np.ndarray) -> np.ndarray:
    """Make a simplex that tries twice the value of each parameter."""
    return np.vstack([center, center + np.log(2.0) * np.eye(len(center))])
