"""Reference implementation of the whole social force, for comparison with the compiled kernel."""

import numpy as np

from pedpred.simulation.forces import border_repulsion, pedestrian_repulsion, sight_weight


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
