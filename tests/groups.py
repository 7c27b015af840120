"""Reference implementation of the group terms of Moussaid et al. 2010 (PLoS ONE 5(4), e10047).

One pure function per term, accelerations in m/s^2, world frame. `pedpred.simulation.kernel` holds the same
formulas compiled; a test compares the two.
"""

import numpy as np

HALF_VIEW_RAD = 0.5 * np.pi  # phi, angle of sight to either side without turning the head
_SMALLEST_M = 1e-9


def gaze(velocity, direction, to_others, settings):
    """Deceleration to see the others, f = -beta_1 alpha v; alpha = angle to the others' centre beyond phi.

    `direction` is e, the direction of gaze, `to_others` leads to the centre of the other members. [N, 2]
    """
    cosine = (direction * _unit(to_others)).sum(axis=-1)
    turn = np.maximum(np.arccos(np.clip(cosine, -1.0, 1.0)) - HALF_VIEW_RAD, 0.0)
    return -settings.group_gaze * turn[:, None] * velocity


def cohesion(to_centre, size, settings):
    """Attraction to the centre of the group, f = beta_2 U, when it is farther than (size - 1) / 2 metres.

    U is the unit vector of `to_centre`, which leads to the centre of all members, m. [N, 2]
    """
    apart = np.linalg.norm(to_centre, axis=-1) > 0.5 * (size - 1)
    return settings.group_attraction * apart[:, None] * _unit(to_centre)


def elbow_room(offset, settings):
    """Repulsion by another member closer than d0, f = beta_3 W; W: unit vector of `offset`. [..., 2]."""
    near = np.linalg.norm(offset, axis=-1) < settings.group_distance_m
    return settings.group_repulsion * near[..., None] * _unit(offset)


def group_acceleration(position, velocity, direction, group, settings):
    """Sum of the group terms; zero for people without others of their group (-1: alone). [N, 2]."""
    together = (group[:, None] == group) & (group[:, None] >= 0) & ~np.eye(len(group), dtype=bool)
    others = together.sum(axis=1)
    offset = position[:, None] - position[None]
    to_others = -(offset * together[..., None]).sum(axis=1) / np.maximum(others, 1)[:, None]
    to_centre = to_others * (others / (others + 1))[:, None]
    total = gaze(velocity, direction, to_others, settings) + cohesion(to_centre, others + 1, settings)
    total += (elbow_room(offset, settings) * together[..., None]).sum(axis=1)
    return total * (others > 0)[:, None]


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), _SMALLEST_M)
