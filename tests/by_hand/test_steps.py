"""Steps of the kernel beside numbers by hand: speeding up, cap, noise, targets, obstacles."""

import numpy as np
import pytest

from pedpred.simulation.crowd import Clock, crowd_of
from pedpred.simulation.kernel import accompany, advance
from tests.by_hand.grounds import FORCES, OPEN, ground_of, routes_along

IDLE = FORCES._replace(relaxation_time_s=1e12, speed_cap=9.0, pedestrian_strength=0.0)
"""Nothing accelerates anybody."""


def walked(crowd, clock, ground=OPEN, routes=None, forces=FORCES, noise=None, reach_m=0.5):
    none = np.zeros((0, len(crowd.position), 2))
    way_on = routes_along([1.0, 0.0]) if routes is None else routes
    return advance(crowd, none if noise is None else noise, clock, ground, way_on, forces, reach_m)


def alone(position, velocity, speed=1.1, plan=(0,)):
    return crowd_of([position], [velocity], [speed], [plan])


@pytest.mark.parametrize(("dt_s", "every"), [(0.05, 1), (0.04, 3)])
@pytest.mark.parametrize("e", [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.6, -0.8)])
def test_velocity_and_position_approach_the_desired_ones_by_hand(e, dt_s, every):
    """v(k) = v0 e + (v(0) - v0 e) (1 - dt / tau)^k and x(k) = x(0) + dt sum v(1..k), for each axis alone."""
    start, v, steps = np.array([0.4, -0.7]), np.array([0.2, 0.1]), np.arange(1, 8)
    crowd = alone(start, v)
    positions, velocities, _ = walked(crowd, Clock(dt_s, 7, every, 1), routes=routes_along(e))
    desired = 1.1 * np.array(e)
    expected = desired + (v - desired) * (1 - dt_s / 0.6) ** steps[:, None]
    where = start + dt_s * np.cumsum(expected, axis=0)
    assert len(positions) == 7 // every
    np.testing.assert_allclose(velocities[:, 0], expected[every - 1 :: every], atol=1e-6)
    np.testing.assert_allclose(positions[:, 0], where[every - 1 :: every], atol=1e-6)
    np.testing.assert_allclose([crowd.position[0], crowd.velocity[0]], [where[-1], expected[-1]], atol=1e-6)


def test_nobody_is_faster_than_the_cap_of_its_own_speed():
    """Both are pulled by v0 e only, at dt = tau: v = v0 e + 2 noise; capped at 1.25 v0 along v."""
    crowd = crowd_of([[0, 0], [50, 0]], np.zeros((2, 2)), [1.0, 2.0], [[0], [0]])
    noise = np.array([[[0.0, 4.0], [0.1, -0.4]]])
    _, velocities, _ = walked(crowd, Clock(0.6, 1, 1, 1), noise=noise)
    np.testing.assert_allclose(velocities[0, 0], 1.25 * np.array([1.0, 2.4]) / 2.6, atol=1e-6)
    np.testing.assert_allclose(velocities[0, 1], [2.06, -0.24], atol=1e-6)


def test_each_random_acceleration_is_held_for_some_steps():
    """v(k + 1) = v(k) + dt ((v0 e - v(k)) / tau + noise); the first lasts two steps, and so the second."""
    crowd = crowd_of([[0, 0], [50, 3]], [[0.5, 0.0], [0.1, -0.2]], [0.9, 0.7], [[0], [1]])
    noise = np.array([[[1.0, 0.3], [0.2, -1.0]], [[-0.7, 0.8], [0.4, 0.9]]])
    v, desired, expected = crowd.velocity.copy(), np.array([[0.54, -0.72], [0.0, 0.7]]), []
    for k in (0, 0, 1, 1):
        v = v + 0.1 * ((desired - v) / 0.6 + noise[k])
        expected.append(v)
    routes = routes_along([0.6, -0.8], [0.0, 1.0])
    positions, velocities, _ = walked(crowd, Clock(0.1, 4, 1, 2), routes=routes, noise=noise)
    np.testing.assert_allclose(velocities, expected, atol=1e-6)
    moved = np.array([[[0.0, 0.0], [50.0, 3.0]]]) + 0.1 * np.cumsum(expected, axis=0)
    np.testing.assert_allclose(positions, moved, atol=1e-6)


def test_the_next_target_follows_within_reach_of_the_present_one():
    """At dt = tau, everybody goes at 1 m/s towards the target that it has then; they are reached at 0.5 m."""
    routes = routes_along([1.0, 0.0], [0.0, 1.0], [0.6, 0.8], target=[[2.0, 1.0], [9.0, 9.0], [-4.0, 3.0]])
    start = [
        [1.66, 1.33], [1.61, 0.68], [2.3, 9.0], [-3.6, 3.2], [-3.9, 3.2], [9.2, 9.1], [9.1, 8.8], [2.1, 1.1],
    ]  # fmt: skip
    plan = [[0, 1, 2], [0, 2, 1], [0, 1, 2], [2, -1, -1], [2, 1, 0], [0, 2, 1], [2, 1, 0], [1, 0, -1]]
    crowd = crowd_of(start, np.zeros((8, 2)), [1.0] * 8, plan)
    crowd.leg[5:] = 2, 1, 1
    forces = FORCES._replace(pedestrian_strength=0.0)
    _, velocities, legs = walked(crowd, Clock(0.6, 1, 1, 1), routes=routes, forces=forces)
    after = [1, 0, 0, 0, 1, 2, 2, 1]  # 0.474, 0.504 and 8 m; 0.447 m at the end of the plan; 0.22 m ...
    assert (legs.tolist(), crowd.leg.tolist()) == ([after], after)
    x, y, turned = [1.0, 0.0], [0.0, 1.0], [0.6, 0.8]
    np.testing.assert_allclose(velocities[0], [y, x, x, turned, y, y, x, x], atol=1e-6)


def test_the_step_of_a_group_adds_its_force():
    """The first and the last walk together; how much the velocity differs in a short step from alone."""
    position = np.array([[-0.9, 1.07], [-0.62, 1.31], [-0.41, 0.72]])
    velocity = np.array([[0.9, -0.2], [-0.3, 0.5], [0.1, 1.4]])
    direction, group, ends = np.array([[0.6, -0.8], [-0.28, 0.96], [0.0, 1.0]]), np.array([0, -1, 0]), []
    for members in (None, group):
        crowd = crowd_of(position, velocity, [9.0] * 3, [[0], [1], [2]], members)
        ends.append(walked(crowd, Clock(0.01, 1, 1, 1), routes=routes_along(*direction))[1][0])
    first, last = (accompany(n, position, velocity, direction, group, FORCES) for n in (0, 2))
    assert np.abs(first).min() > 0.5
    np.testing.assert_allclose((ends[1] - ends[0]) / 0.01, [first, (0.0, 0.0), last], atol=1e-5)


WALLED = np.array([[0, 1, 0], [0, 0, 0], [0, 1, 1], [1, 0, 1]], bool)
"""Cells of 0.5 m from (-1, 2) on: rows along y at x = -1, -0.5, 0 and 0.5."""


@pytest.mark.parametrize(
    ("start", "step", "taken"),
    [
        ((-0.2, 2.3), (0.1, 0.1), (0.1, 0.1)),  # on free ground
        ((-0.2, 2.7), (0.3, 0.1), (0.0, 0.1)),  # a wall along y
        ((0.3, 2.45), (0.1, 0.2), (0.1, 0.0)),  # a wall along x
        ((-0.05, 2.45), (0.1, 0.1), (0.1, 0.0)),  # a corner, which has both ways: along x
        ((0.55, 2.95), (-0.1, 0.1), (0.0, 0.0)),  # a niche
        ((0.1, 3.1), (0.1, 0.1), (0.1, 0.1)),  # who is in an obstacle walks on
        ((-1.6, 2.2), (0.2, 0.1), (0.2, 0.1)),  # all is free outside, on the four sides
        ((0.7, 1.4), (0.1, 0.2), (0.1, 0.2)),
        ((0.9, 2.7), (0.2, 0.1), (0.2, 0.1)),
        ((-0.3, 3.4), (0.1, 0.2), (0.1, 0.2)),
        ((-1.2, 2.7), (0.4, 0.1), (0.0, 0.1)),  # from outside into the first row
        ((0.7, 1.9), (0.1, 0.2), (0.1, 0.0)),  # and into the first column
    ],
)
def test_a_step_into_an_obstacle_becomes_one_along_it(start, step, taken):
    ground = ground_of(np.full((4, 3, 3), [1e3, 0.0, 0.0]), (-1.0, 2.0), 0.5, WALLED)
    crowd = alone(start, np.array(step) / 0.4)
    positions, velocities, _ = walked(crowd, Clock(0.4, 1, 1, 1), ground, forces=IDLE)
    np.testing.assert_allclose(positions[0, 0], np.add(start, taken), atol=1e-9)
    np.testing.assert_allclose(velocities[0, 0], np.array(taken) / 0.4, atol=1e-9)
