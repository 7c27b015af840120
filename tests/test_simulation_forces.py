"""Laws of the social forces, and the compiled kernel against the pure functions."""

import numpy as np
import pytest

from pedpred.scenes import OccupancyMap
from pedpred.simulation import forces, kernel
from pedpred.simulation.ground import ground_of, interpolate, signed_distance
from tests.simulated import SETTINGS

FORCES = SETTINGS.forces
BLIND = FORCES._replace(unseen_weight=1.0)  # without anisotropy


def numerical_gradient(potential, points, step=1e-6):
    steps = step * np.eye(2)
    return np.stack([(potential(points + s) - potential(points - s)) / (2 * step) for s in steps], axis=-1)


def free_acceleration(position, velocity, settings):
    """Forces on people who already walk as they wish, far from any obstacle."""
    speed = np.linalg.norm(velocity, axis=-1)
    far, nowhere = np.full(len(position), 100.0), np.zeros_like(position)
    direction = velocity / speed[:, None]
    return forces.social_acceleration(position, velocity, direction, speed, far, nowhere, settings)


@pytest.mark.parametrize("gap_m", [0.4, 1.0, 2.0])
def test_two_equal_pedestrians_push_each_other_equally(gap_m):
    position = np.array([[0.0, 0.0], [gap_m, 0.3]])
    velocity = np.array([[1.2, 0.1], [-1.2, -0.1]])
    pushes = free_acceleration(position, velocity, BLIND)
    assert np.linalg.norm(pushes[0]) > 1e-6
    np.testing.assert_allclose(pushes[0], -pushes[1], atol=1e-12)


def test_a_pedestrian_behind_is_felt_less():
    position, velocity = np.array([[0.0, 0.0], [-0.6, 0.0]]), np.array([[1.0, 0.0], [1.0, 0.0]])
    weak, full = (free_acceleration(position, velocity, s)[0] for s in (FORCES, BLIND))
    np.testing.assert_allclose(weak, FORCES.unseen_weight * full)


def test_pedestrian_repulsion_is_minus_the_gradient_of_its_potential():
    rng = np.random.default_rng(0)
    offset, stride = rng.normal(0.0, 1.5, (200, 2)), rng.normal(0.0, 0.6, (200, 2))
    clear = forces.ellipse_axis(offset, stride) > 0.05  # the potential has a ridge between the foci
    offset, stride = offset[clear], stride[clear]
    expected = -numerical_gradient(lambda r: forces.pedestrian_potential(r, stride, FORCES), offset)
    np.testing.assert_allclose(
        forces.pedestrian_repulsion(offset, stride, FORCES), expected, atol=1e-5, rtol=1e-5
    )


def test_border_repulsion_is_minus_the_gradient_of_its_potential():
    points = np.random.default_rng(1).uniform(0.2, 2.0, (50, 2))  # around an obstacle at the origin
    expected = -numerical_gradient(
        lambda p: forces.border_potential(np.linalg.norm(p, axis=-1), FORCES), points
    )
    distance = np.linalg.norm(points, axis=-1)
    found = forces.border_repulsion(distance, points / distance[:, None], FORCES)
    np.testing.assert_allclose(found, expected, atol=1e-6, rtol=1e-6)


def test_driving_reaches_the_desired_velocity_in_tau():
    pull = forces.driving_acceleration(np.zeros((1, 2)), np.array([[0.0, 1.0]]), np.array([1.3]), 0.5)
    np.testing.assert_allclose(pull, [[0.0, 2.6]])


def test_signed_distance_is_exact_along_straight_borders():
    occupied = np.zeros((20, 10), dtype=bool)
    occupied[:5] = True
    np.testing.assert_allclose(signed_distance(occupied, 0.1)[:, 3], 0.1 * (np.arange(20) + 0.5) - 0.5)


def test_kernel_equals_the_pure_functions():
    rng = np.random.default_rng(2)
    occupied = rng.random((80, 80)) < 0.01
    ground = ground_of(OccupancyMap(occupied, np.array([-4.0, -4.0]), 0.1))
    position, velocity = rng.uniform(-4.2, 4.2, (30, 2)), rng.normal(0.0, 1.0, (30, 2))
    direction = velocity[::-1] / np.linalg.norm(velocity[::-1], axis=-1, keepdims=True)
    speed = rng.uniform(0.8, 2.0, 30)
    cells = (position - ground.origin) / ground.resolution_m
    distance = interpolate(ground.distance, cells)
    away = np.stack([interpolate(ground.away[..., axis], cells) for axis in range(2)], axis=-1)
    expected = forces.social_acceleration(position, velocity, direction, speed, distance, away, FORCES)
    found = np.empty_like(position)
    kernel.accelerations(position, velocity, direction, speed, ground, FORCES, found)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
