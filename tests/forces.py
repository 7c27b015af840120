"""Reference implementation of the social forces of Helbing & Molnar 1995 (Phys. Rev. E 51, 4282).

One pure function per term, accelerations (mass 1) in m/s^2, world frame. `pedpred.simulation.kernel` holds
the same formulas compiled; tests compare the two.
"""

import numpy as np

_SMALLEST_M = 1e-3  # lower bound of b and |r|: the gradient is undefined at the foci of the ellipse


def ellipse_axis(offset, stride):
    """Semi-minor axis b, m, 2b = sqrt((|r| + |r - y|)^2 - |y|^2). Helbing & Molnar 1995, eq. 4. [...].

    `offset` is r, from the other pedestrian to this one, `stride` is y = |v| Delta t e of the other. [..., 2]
    """
    perimeter = np.linalg.norm(offset, axis=-1) + np.linalg.norm(offset - stride, axis=-1)
    return 0.5 * np.sqrt(np.maximum(perimeter**2 - (stride**2).sum(axis=-1), 4.0 * _SMALLEST_M**2))


def pedestrian_potential(offset, stride, settings):
    """V(b) = V0 exp(-b / sigma). Helbing & Molnar 1995, eq. 3 and 13. [...] m^2/s^2."""
    axis = ellipse_axis(offset, stride)
    return settings.pedestrian_strength * np.exp(-axis / settings.pedestrian_range_m)


def pedestrian_repulsion(offset, stride, settings):
    """Repulsion by the other pedestrian, f = -grad_r V(b). Helbing & Molnar 1995, eq. 3. [..., 2].

    With n(a) = a / |a|: grad b = (|r| + |r - y|) / (4 b) (n(r) + n(r - y)); r and y as in `ellipse_axis`.
    """
    ahead = offset - stride
    here, there = np.linalg.norm(offset, axis=-1), np.linalg.norm(ahead, axis=-1)
    units = (
        offset / np.maximum(here, _SMALLEST_M)[..., None] + ahead / np.maximum(there, _SMALLEST_M)[..., None]
    )
    axis = ellipse_axis(offset, stride)
    steepness = pedestrian_potential(offset, stride, settings) / settings.pedestrian_range_m
    return (steepness * (here + there) / (4.0 * axis))[..., None] * units


def sight_weight(force, direction, settings):
    """Anisotropy, w = 1 if e . (-f) >= |f| cos(phi), else c. Helbing & Molnar 1995, eq. 7 and 8. [...].

    The source of the `force` f lies in the direction of -f; `direction` is e of the repelled one. [..., 2]
    """
    along = direction[..., 0] * force[..., 0] + direction[..., 1] * force[..., 1]  # vecdot is slow on pairs
    seen = -along >= np.linalg.norm(force, axis=-1) * settings.sight_cosine
    return np.where(seen, 1.0, settings.unseen_weight)


def border_potential(distance, settings):
    """U(d) = U0 exp(-d / R). Helbing & Molnar 1995, eq. 5 and 13. [...] m^2/s^2."""
    return settings.border_strength * np.exp(-distance / settings.border_range_m)


def border_repulsion(distance, away, settings):
    """Repulsion by the nearest obstacle point, -grad U = U0 / R exp(-d / R) grad d. Eq. 5. [..., 2].

    `distance` d is negative inside an obstacle; `away` is its gradient.
    """
    return (border_potential(distance, settings) / settings.border_range_m)[..., None] * away


def driving_acceleration(velocity, direction, desired_speed, relaxation_time_s):
    """Pull towards the goal, (v0 e - v) / tau. Helbing & Molnar 1995, eq. 2. [N, 2]."""
    return (desired_speed[:, None] * direction - velocity) / relaxation_time_s


def social_acceleration(position, velocity, direction, desired_speed, distance, away, settings):
    """Sum of all forces but the noise on each pedestrian of a crowd. Helbing & Molnar 1995, eq. 9. [N, 2].

    `direction` is e, the unit vector of the way to the goal, `away` the gradient of the `distance` to the
    nearest obstacle point.
    """
    total = driving_acceleration(velocity, direction, desired_speed, settings.relaxation_time_s)
    total = total + border_repulsion(distance, away, settings)
    stride = np.linalg.norm(velocity, axis=-1)[:, None] * settings.anticipation_s * direction
    offset = position[:, None] - position[None, :]
    push = pedestrian_repulsion(offset, stride[None, :], settings)
    weight = sight_weight(push, direction[:, None], settings)
    others = ~np.eye(len(position), dtype=bool)
    return total + (push * (weight * others)[..., None]).sum(axis=1)
