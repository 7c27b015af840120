"""The compiled inner loop of the simulator.

The forces are those of Helbing & Molnar 1995 (Phys. Rev. E 51, 4282), and of Moussaid et al. 2010 for groups;
tests compare them with plain implementations. Repulsion from beyond `interaction_range_m` is neglected, and
people are sorted into square cells of that side, so that a step costs O(N) at constant density.
"""

from __future__ import annotations

import math

import numpy as np

from pedpred.compiled import compiled
from pedpred.simulation.physics import SMALLEST_AXIS_M, border, ellipse_axis, unit, way

WEAKEST_PUSH_MPS2 = 1e-3  # weaker repulsion is neglected; the noise is 300 times as strong


@compiled
def interaction_range_m(stride_m, forces):
    """Distance beyond which repulsion is neglected if no stride s exceeds `stride_m`.

    |r| + |r - y| >= 2 |r| - s implies b >= sqrt(|r| (|r| - s)); the range is where this bound reaches the
    b of the weakest repulsion.
    """
    strength = max(forces.pedestrian_strength / forces.pedestrian_range_m, WEAKEST_PUSH_MPS2)
    axis = forces.pedestrian_range_m * math.log(strength / WEAKEST_PUSH_MPS2)
    return 0.5 * stride_m + math.sqrt(axis * axis + 0.25 * stride_m * stride_m) + SMALLEST_AXIS_M


@compiled
def _cells(position, side):
    """Square cells around the crowd: lower corner, side, first person of each, next person in the same.

    The side grows if people are sparse, so that there are not many more cells than people.
    """
    low_x, low_y = position[:, 0].min(), position[:, 1].min()
    width, depth = position[:, 0].max() - low_x, position[:, 1].max() - low_y
    side = max(side, max(width, depth) / (math.sqrt(len(position)) + 1.0))
    first = np.full((int(width / side) + 1, int(depth / side) + 1), -1)
    following = np.empty(len(position), dtype=np.int64)
    for n in range(len(position) - 1, -1, -1):
        i, j = int((position[n, 0] - low_x) / side), int((position[n, 1] - low_y) / side)
        following[n], first[i, j] = first[i, j], n
    return low_x, low_y, side, first, following


@compiled
def _push(r_x, r_y, y_x, y_y, e_x, e_y, forces):
    """Repulsion of one pair, m/s^2, weighted by what is seen. Helbing & Molnar 1995, eq. 3, 7 and 8.

    r leads from the other pedestrian to this one, y is the stride of the other, e the desired direction; with
    n(a) = a / |a|, f = V0 / sigma exp(-b / sigma) (|r| + |r - y|) / (4 b) (n(r) + n(r - y)).
    """
    a_x, a_y = r_x - y_x, r_y - y_y
    here, there = math.sqrt(r_x * r_x + r_y * r_y), math.sqrt(a_x * a_x + a_y * a_y)
    axis = ellipse_axis(here, there, y_x * y_x + y_y * y_y)
    push = forces.pedestrian_strength / forces.pedestrian_range_m
    push *= math.exp(-axis / forces.pedestrian_range_m) * (here + there) / (4.0 * axis)
    here, there = max(here, SMALLEST_AXIS_M), max(there, SMALLEST_AXIS_M)
    f_x, f_y = push * (r_x / here + a_x / there), push * (r_y / here + a_y / there)
    if -(e_x * f_x + e_y * f_y) < math.sqrt(f_x * f_x + f_y * f_y) * forces.sight_cosine:
        return f_x * forces.unseen_weight, f_y * forces.unseen_weight
    return f_x, f_y


@compiled
def _pedestrians(n, position, stride, direction, range_m, cells, forces):
    """Sum of the repulsions on pedestrian n by all within a range."""
    low_x, low_y, side, first, following = cells
    total_x, total_y = 0.0, 0.0
    i, j = int((position[n, 0] - low_x) / side), int((position[n, 1] - low_y) / side)
    for g in range(max(i - 1, 0), min(i + 2, first.shape[0])):
        for h in range(max(j - 1, 0), min(j + 2, first.shape[1])):
            m = first[g, h]
            while m >= 0:
                r_x, r_y = position[n, 0] - position[m, 0], position[n, 1] - position[m, 1]
                if m != n and r_x * r_x + r_y * r_y <= range_m * range_m:
                    f_x, f_y = _push(
                        r_x, r_y, stride[m, 0], stride[m, 1], direction[n, 0], direction[n, 1], forces
                    )
                    total_x, total_y = total_x + f_x, total_y + f_y
                m = following[m]
    return total_x, total_y


@compiled
def accelerations(position, velocity, direction, desired_speed, ground, forces, out):
    """Write the sum of all forces on a crowd (N > 0) to `out`. Helbing & Molnar 1995, eq. 9. [N, 2] m/s^2."""
    stride, longest = np.empty_like(position), 0.0
    for n in range(len(position)):
        length = math.sqrt(velocity[n, 0] ** 2 + velocity[n, 1] ** 2) * forces.anticipation_s
        stride[n, 0], stride[n, 1] = length * direction[n, 0], length * direction[n, 1]
        longest = max(longest, length)
    range_m = interaction_range_m(longest, forces)
    cells = _cells(position, range_m)
    for n in range(len(position)):
        distance, away_x, away_y = border(position[n, 0], position[n, 1], ground)
        wall = forces.border_strength / forces.border_range_m * math.exp(-distance / forces.border_range_m)
        f_x, f_y = _pedestrians(n, position, stride, direction, range_m, cells, forces)
        drive_x = (desired_speed[n] * direction[n, 0] - velocity[n, 0]) / forces.relaxation_time_s
        drive_y = (desired_speed[n] * direction[n, 1] - velocity[n, 1]) / forces.relaxation_time_s
        out[n, 0] = drive_x + wall * away_x + f_x
        out[n, 1] = drive_y + wall * away_y + f_y


@compiled
def accompany(n, position, velocity, direction, group, forces):
    """Group force on pedestrian n (Moussaid et al. 2010), m/s^2."""
    others, sum_x, sum_y, push_x, push_y = 0, 0.0, 0.0, 0.0, 0.0
    for m in range(len(position)):
        if m != n and group[m] == group[n]:
            to_x, to_y = position[m, 0] - position[n, 0], position[m, 1] - position[n, 1]
            others, sum_x, sum_y = others + 1, sum_x + to_x, sum_y + to_y
            if math.sqrt(to_x * to_x + to_y * to_y) < forces.group_distance_m:
                w_x, w_y = unit(to_x, to_y)
                push_x, push_y = push_x - w_x, push_y - w_y
    if others == 0:
        return 0.0, 0.0
    u_x, u_y = unit(sum_x, sum_y)
    far = math.sqrt(sum_x * sum_x + sum_y * sum_y) / (others + 1) > 0.5 * others
    pull = forces.group_attraction if far else 0.0
    cosine = min(max(direction[n, 0] * u_x + direction[n, 1] * u_y, -1.0), 1.0)
    slow = forces.group_gaze * max(math.acos(cosine) - 0.5 * math.pi, 0.0)
    f_x = pull * u_x + forces.group_repulsion * push_x - slow * velocity[n, 0]
    f_y = pull * u_y + forces.group_repulsion * push_y - slow * velocity[n, 1]
    return f_x, f_y


@compiled
def _blocked(x, y, ground):
    i = math.floor((x - ground.origin[0]) / ground.resolution_m)
    j = math.floor((y - ground.origin[1]) / ground.resolution_m)
    shape = ground.occupied.shape
    return 0 <= i < shape[0] and 0 <= j < shape[1] and ground.occupied[i, j]


@compiled
def _move(n, position, velocity, dt, ground):
    """Take the step, or its component along x or y that enters no obstacle; adapt the velocity."""
    x, y = position[n, 0], position[n, 1]
    next_x, next_y = x + velocity[n, 0] * dt, y + velocity[n, 1] * dt
    if _blocked(next_x, next_y, ground) and not _blocked(x, y, ground):
        if not _blocked(next_x, y, ground):
            next_y = y
        elif not _blocked(x, next_y, ground):
            next_x = x
        else:
            next_x, next_y = x, y
        velocity[n, 0], velocity[n, 1] = (next_x - x) / dt, (next_y - y) / dt
    position[n, 0], position[n, 1] = next_x, next_y


@compiled
def _heading(n, crowd, routes, reach_m):
    """Switch to the next target if the current one is reached; return the desired direction of n."""
    x, y = crowd.position[n, 0], crowd.position[n, 1]
    plan, leg = crowd.plan[n], crowd.leg[n]
    if leg + 1 < len(plan) and plan[leg + 1] >= 0:
        to_x, to_y = routes.target[plan[leg], 0] - x, routes.target[plan[leg], 1] - y
        if to_x * to_x + to_y * to_y <= reach_m * reach_m:
            leg += 1
            crowd.leg[n] = leg
    return way(x, y, plan[leg], routes)


@compiled
def advance(crowd, noise, clock, ground, routes, forces, reach_m):
    """Simulate a `Crowd` by the steps of a `Clock`; its position, velocity and leg are changed in place.

    Semi-implicit Euler: v += a dt, capped at `speed_cap` v0, then x += v dt. `noise` [H, N, 2] holds random
    accelerations, m/s^2, each held for `clock.hold` steps; it is empty for none. A target is reached at the
    distance `reach_m`; people stay around the last one of their plan.

    Returns:
        Positions [R, N, 2], velocities [R, N, 2] and legs [R, N] after each `clock.every` steps.
    """
    position, velocity = crowd.position, crowd.velocity
    count, records = len(position), clock.steps // clock.every
    positions, velocities = np.empty((records, count, 2)), np.empty((records, count, 2))
    legs = np.empty((records, count), dtype=np.int64)
    direction, acceleration = np.empty((count, 2)), np.empty((count, 2))
    for step in range(clock.steps):
        for n in range(count):
            direction[n, 0], direction[n, 1] = _heading(n, crowd, routes, reach_m)
        accelerations(position, velocity, direction, crowd.desired_speed, ground, forces, acceleration)
        for n in range(count):
            if crowd.group[n] >= 0:
                f_x, f_y = accompany(n, position, velocity, direction, crowd.group, forces)
                acceleration[n, 0], acceleration[n, 1] = acceleration[n, 0] + f_x, acceleration[n, 1] + f_y
        for n in range(count):
            if len(noise) > 0:
                acceleration[n, 0] += noise[step // clock.hold, n, 0]
                acceleration[n, 1] += noise[step // clock.hold, n, 1]
            v_x = velocity[n, 0] + acceleration[n, 0] * clock.dt_s
            v_y = velocity[n, 1] + acceleration[n, 1] * clock.dt_s
            speed, most = math.sqrt(v_x * v_x + v_y * v_y), forces.speed_cap * crowd.desired_speed[n]
            scale = most / speed if speed > most else 1.0
            velocity[n, 0], velocity[n, 1] = v_x * scale, v_y * scale
            _move(n, position, velocity, clock.dt_s, ground)
        if (step + 1) % clock.every == 0:
            row = (step + 1) // clock.every - 1
            for n in range(count):  # number by number: assigning arrays takes seconds to compile
                positions[row, n, 0], positions[row, n, 1] = position[n, 0], position[n, 1]
                velocities[row, n, 0], velocities[row, n, 1] = velocity[n, 0], velocity[n, 1]
                legs[row, n] = crowd.leg[n]
    return positions, velocities, legs
