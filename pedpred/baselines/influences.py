"""Forces on pedestrians between two observations, under each possible goal."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pedpred.simulation.forces import ForceSettings, border_repulsion, pedestrian_repulsion, sight_weight
from pedpred.simulation.ground import Ground, interpolate
from pedpred.simulation.routing import Routes, directions_at

_STAGES = 3  # points of an interval where forces are looked up; with 1 or 2 collisions are misjudged
_SMALLEST = 1e-9


class Observations(NamedTuple):
    """States of pedestrians, row by row.

    Attributes:
        position: world frame, m. [N, 2]
        velocity: m/s. [N, 2]
    """

    position: np.ndarray
    velocity: np.ndarray

    def at(self, rows: np.ndarray) -> Observations:
        """Some of the rows."""
        return Observations(self.position[rows], self.velocity[rows])


class Influences(NamedTuple):
    """Means over an interval, per pedestrian and goal.

    Attributes:
        direction: e, desired direction (unit vectors at each point of the interval). [N, G, 2]
        push: f, of obstacles and others, m/s^2. [N, G, 2]
    """

    direction: np.ndarray
    push: np.ndarray


def influences_between(
    start: Observations,
    end: Observations,
    dt_s: float,
    probability: np.ndarray,
    ground: Ground,
    routes: Routes,
    forces: ForceSettings,
) -> Influences:
    """Average the forces along the observed path, weighted by their effect on the last velocity.

    A push of some age counts exp(-age / tau). The others' ellipses point along their believed directions.

    Args:
        start: pedestrians of one instant. [N]
        end: the same pedestrians, one interval later. [N]
        dt_s: length of the interval, s.
        probability: of all goals, believed at the start. [N, G]
        ground: obstacles.
        routes: ways to the goals.
        forces: constants of the model.
    """
    share = (np.arange(_STAGES) + 0.5) / _STAGES
    weight = np.exp(-(1.0 - share) * dt_s / forces.relaxation_time_s)
    directions, pushes = [], []
    for s in share:
        here = between(start, end, dt_s, s)
        ways = directions_at(here.position, routes)
        push = others_push(here, ways, probability, forces)
        pushes.append(push + _border_push(here.position, ground, forces)[:, None])
        directions.append(ways)
    return Influences(*(np.average(values, axis=0, weights=weight) for values in (directions, pushes)))


def between(start: Observations, end: Observations, dt_s: float, share: float) -> Observations:
    """Interpolate the state after a share of an interval, on the cubic with both velocities (Hermite)."""
    s = share
    position = (
        (2 * s**3 - 3 * s**2 + 1) * start.position
        + (s**3 - 2 * s**2 + s) * dt_s * start.velocity
        + (3 * s**2 - 2 * s**3) * end.position
        + (s**3 - s**2) * dt_s * end.velocity
    )
    return Observations(position, (1 - s) * start.velocity + s * end.velocity)


def others_push(
    here: Observations, ways: np.ndarray, probability: np.ndarray, forces: ForceSettings
) -> np.ndarray:
    """Sum the repulsion of all others; a pedestrian's own goal decides whom it sees.

    Args:
        here: all people. [N]
        ways: desired directions to all goals. [N, G, 2]
        probability: of all goals. [N, G]
        forces: constants of the model.

    Returns:
        Acceleration of each pedestrian under each of its goals, m/s^2. [N, G, 2]
    """
    believed = (probability[..., None] * ways).sum(axis=1)
    believed /= np.maximum(np.linalg.norm(believed, axis=-1, keepdims=True), _SMALLEST)
    stride = np.linalg.norm(here.velocity, axis=-1, keepdims=True) * forces.anticipation_s * believed
    force = pedestrian_repulsion(here.position[:, None] - here.position[None], stride[None], forces)
    force[np.diag_indices(len(force))] = 0.0
    return sight_weight(force[:, None], ways[:, :, None], forces) @ force


def _border_push(points: np.ndarray, ground: Ground, forces: ForceSettings) -> np.ndarray:
    """Repulsion of the nearest obstacle point, m/s^2. [N, 2]."""
    cells = (points - ground.origin) / ground.resolution_m
    fields = (ground.distance, ground.away[..., 0], ground.away[..., 1])
    distance, *away = (interpolate(field, cells) for field in fields)
    return border_repulsion(distance, np.stack(away, axis=-1), forces)
