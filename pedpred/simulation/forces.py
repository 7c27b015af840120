"""The social forces of Helbing & Molnar 1995 (Phys. Rev. E 51, 4282), one pure function per term.

All are accelerations (mass 1), m/s^2, world frame. `kernel.py` holds the same formulas compiled, and
the driving term; tests compare the two.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from pedpred.settings import In

SMALLEST_AXIS_M = 1e-3  # lower bound of b and |r|: the gradient is undefined at the foci of the ellipse


class ForceSettings(NamedTuple):
    """Constants of the model, Helbing & Molnar 1995, section III.

    Attributes:
        relaxation_time_s: tau, time to regain the desired velocity.
        speed_cap: largest speed as a multiple of the desired one.
        pedestrian_strength: V0, m^2/s^2.
        pedestrian_range_m: sigma.
        anticipation_s: Delta t, the ellipse looks s = |v| Delta t ahead of the other.
        border_strength: U0, m^2/s^2.
        border_range_m: R.
        sight_cosine: cosine of the half angle of sight.
        unseen_weight: c, weight of a force from outside the field of sight.
        group_gaze: beta_1 of Moussaid et al. 2010, 1/s per radian.
        group_attraction: beta_2, m/s^2.
        group_repulsion: beta_3, m/s^2.
        group_distance_m: d0, members closer than this repel each other.
    """

    relaxation_time_s: Annotated[float, In("(0, 100]")]
    speed_cap: Annotated[float, In("(0, 100]")]
    pedestrian_strength: Annotated[float, In("[0, 10000]")]
    pedestrian_range_m: Annotated[float, In("(0, 100]")]
    anticipation_s: Annotated[float, In("[0, 10000]")]
    border_strength: Annotated[float, In("[0, 10000]")]
    border_range_m: Annotated[float, In("(0, 100]")]
    sight_cosine: Annotated[float, In("[-1, 1]")]
    unseen_weight: Annotated[float, In("[0, 1]")]
    group_gaze: Annotated[float, In("[0, 10000]")]
    group_attraction: Annotated[float, In("[0, 10000]")]
    group_repulsion: Annotated[float, In("[0, 10000]")]
    group_distance_m: Annotated[float, In("[0, 10000]")]


def ellipse_axis(offset: np.ndarray, stride: np.ndarray) -> np.ndarray:
    """Semi-minor axis, 2b = sqrt((|r| + |r - y|)^2 - |y|^2). Helbing & Molnar 1995, eq. 4.

    Args:
        offset: r, from the other pedestrian to this one, m. [..., 2]
        stride: y = |v| Delta t e of the other pedestrian, m. [..., 2]

    Returns:
        b, m. [...]
    """
    perimeter = np.linalg.norm(offset, axis=-1) + np.linalg.norm(offset - stride, axis=-1)
    return 0.5 * np.sqrt(np.maximum(perimeter**2 - (stride**2).sum(axis=-1), 4.0 * SMALLEST_AXIS_M**2))


def pedestrian_potential(offset: np.ndarray, stride: np.ndarray, settings: ForceSettings) -> np.ndarray:
    """V(b) = V0 exp(-b / sigma). Helbing & Molnar 1995, eq. 3 and 13. [...] m^2/s^2."""
    axis = ellipse_axis(offset, stride)
    return settings.pedestrian_strength * np.exp(-axis / settings.pedestrian_range_m)


def pedestrian_repulsion(offset: np.ndarray, stride: np.ndarray, settings: ForceSettings) -> np.ndarray:
    """Repulsion by the other pedestrian, f = -grad_r V(b). Helbing & Molnar 1995, eq. 3.

    With n(a) = a / |a|: grad b = (|r| + |r - y|) / (4 b) (n(r) + n(r - y)).

    Args:
        offset: r, from the other pedestrian to this one, m. [..., 2]
        stride: y, see `ellipse_axis`, m. [..., 2]
        settings: V0 and sigma.

    Returns:
        Acceleration of this pedestrian. [..., 2]
    """
    ahead = offset - stride
    here, there = np.linalg.norm(offset, axis=-1), np.linalg.norm(ahead, axis=-1)
    units = (
        offset / np.maximum(here, SMALLEST_AXIS_M)[..., None]
        + ahead / np.maximum(there, SMALLEST_AXIS_M)[..., None]
    )
    axis = ellipse_axis(offset, stride)
    steepness = pedestrian_potential(offset, stride, settings) / settings.pedestrian_range_m
    return (steepness * (here + there) / (4.0 * axis))[..., None] * units


def sight_weight(force: np.ndarray, direction: np.ndarray, settings: ForceSettings) -> np.ndarray:
    """Anisotropy, w = 1 if e . (-f) >= |f| cos(phi), else c. Helbing & Molnar 1995, eq. 7 and 8.

    Args:
        force: repulsion f; its source lies in the direction of -f. [..., 2]
        direction: e, desired walking direction of the repelled pedestrian. [..., 2]
        settings: cos(phi) and c.

    Returns:
        Weight. [...]
    """
    along = direction[..., 0] * force[..., 0] + direction[..., 1] * force[..., 1]  # vecdot is slow on pairs
    seen = -along >= np.linalg.norm(force, axis=-1) * settings.sight_cosine
    return np.where(seen, 1.0, settings.unseen_weight)


def border_potential(distance: np.ndarray, settings: ForceSettings) -> np.ndarray:
    """U(d) = U0 exp(-d / R). Helbing & Molnar 1995, eq. 5 and 13. [...] m^2/s^2."""
    return settings.border_strength * np.exp(-distance / settings.border_range_m)


def border_repulsion(distance: np.ndarray, away: np.ndarray, settings: ForceSettings) -> np.ndarray:
    """Repulsion by the nearest obstacle point, -grad U = U0 / R exp(-d / R) grad d. Eq. 5.

    Args:
        distance: d, to the nearest obstacle point, m; negative inside. [...]
        away: grad d, a unit vector except midway between two obstacle points. [..., 2]
        settings: U0 and R.

    Returns:
        Acceleration. [..., 2]
    """
    return (border_potential(distance, settings) / settings.border_range_m)[..., None] * away
