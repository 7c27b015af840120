"""Laws of the social forces, and the compiled kernel against the pure functions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.geometry import rotate
from pedpred.scenes import OccupancyMap
from pedpred.simulation import kernel
from pedpred.simulation.ground import ground_of, interpolate, signed_distance
from tests import forces
from tests.forces import driving_acceleration, social_acceleration
from tests.simulated import SETTINGS

FORCES = SETTINGS.forces
BLIND = FORCES._replace(unseen_weight=1.0)  # without anisotropy


def numerical_gradient(potential, points, step=1e-6):
    steps = step * np.eye(2)
    return np.stack([(potential(points + s) - potential(points - s)) / (2 * step) for s in steps], axis=-1)


def free_acceleration(position, velocity, settings):
    """Forces on people at their desired velocity, far from obstacles."""
    speed = np.linalg.norm(velocity, axis=-1)
    far, nowhere = np.full(len(position), 100.0), np.zeros_like(position)
    direction = velocity / speed[:, None]
    return social_acceleration(position, velocity, direction, speed, far, nowhere, settings)


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
    found = forces.pedestrian_repulsion(offset, stride, FORCES)
    np.testing.assert_allclose(found, expected, atol=1e-5, rtol=1e-5)


def test_border_repulsion_is_minus_the_gradient_of_its_potential():
    def potential(points):
        return forces.border_potential(np.linalg.norm(points, axis=-1), FORCES)

    points = np.random.default_rng(1).uniform(0.2, 2.0, (50, 2))  # around an obstacle at the origin
    expected = -numerical_gradient(potential, points)
    distance = np.linalg.norm(points, axis=-1)
    found = forces.border_repulsion(distance, points / distance[:, None], FORCES)
    np.testing.assert_allclose(found, expected, atol=1e-6, rtol=1e-6)


def test_driving_reaches_the_desired_velocity_in_tau():
    pull = driving_acceleration(np.zeros((1, 2)), np.array([[0.0, 1.0]]), np.array([1.3]), 0.5)
    np.testing.assert_allclose(pull, [[0.0, 2.6]])


def test_signed_distance_is_exact_along_straight_borders():
    occupied = np.zeros((20, 10), dtype=bool)
    occupied[:5] = True
    np.testing.assert_allclose(signed_distance(occupied, 0.1)[:, 3], 0.1 * (np.arange(20) + 0.5) - 0.5)


def crowd_on_some_ground(rng, side_m, people):
    """What both force implementations are told about the same crowd."""
    occupied = rng.random((80, 80)) < 0.01
    ground = ground_of(OccupancyMap(occupied, np.array([-4.0, -4.0]), 0.1))
    position, velocity = rng.uniform(-side_m / 2, side_m / 2, (people, 2)), rng.normal(0.0, 1.0, (people, 2))
    direction = rng.normal(0.0, 1.0, (people, 2))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    return ground, (position, velocity, direction, rng.uniform(0.8, 2.0, people))


def compiled(ground, crowd):
    found = np.empty_like(crowd[0])
    kernel.accelerations(*crowd, ground, FORCES, found)
    return found


def pure(ground, crowd):
    cells = (crowd[0] - ground.origin) / ground.resolution_m
    distance = interpolate(ground.distance, cells)
    away = np.stack([interpolate(ground.away[..., axis], cells) for axis in range(2)], axis=-1)
    return social_acceleration(*crowd, distance, away, FORCES)


def test_kernel_equals_the_pure_functions_where_all_are_near():
    ground, crowd = crowd_on_some_ground(np.random.default_rng(2), 1.8, 30)
    np.testing.assert_allclose(compiled(ground, crowd), pure(ground, crowd), rtol=1e-9, atol=1e-9)


@given(st.integers(0, 10_000), st.sampled_from([3.0, 8.0, 40.0, 400.0]), st.integers(1, 120))
def test_kernel_neglects_only_the_weakest_pushes(seed, side_m, people):
    ground, crowd = crowd_on_some_ground(np.random.default_rng(seed), side_m, people)
    neglected = np.linalg.norm(compiled(ground, crowd) - pure(ground, crowd), axis=-1)
    assert neglected.max() <= people * 1.5 * kernel.WEAKEST_PUSH_MPS2


@given(st.floats(0.0, 2.0), st.floats(0.0, 6.3), st.floats(0.0, 5.0))
def test_beyond_the_interaction_range_every_push_is_weak(stride_m, angle, more_m):
    away = kernel.interaction_range_m(stride_m, FORCES) + more_m
    offset = away * np.array([np.cos(angle), np.sin(angle)])
    push = forces.pedestrian_repulsion(offset, np.array([stride_m, 0.0]), FORCES)
    assert np.linalg.norm(push) <= 1.1 * kernel.WEAKEST_PUSH_MPS2


@given(st.integers(0, 10_000), st.floats(-3.1, 3.1), st.floats(-50.0, 50.0))
def test_forces_turn_and_move_with_the_crowd(seed, angle, shift_m):
    rng = np.random.default_rng(seed)
    position, velocity = rng.normal(0.0, 1.5, (6, 2)), rng.normal(0.0, 1.0, (6, 2))
    moved = free_acceleration(rotate(position, angle) + shift_m, rotate(velocity, angle), BLIND)
    np.testing.assert_allclose(moved, rotate(free_acceleration(position, velocity, BLIND), angle), atol=1e-8)


@given(st.floats(0.01, 3.0), st.floats(-3.1, 3.1))
def test_a_border_pushes_straight_away_and_less_from_afar(distance, angle):
    away = np.array([[np.cos(angle), np.sin(angle)]])
    near, far = (forces.border_repulsion(np.array([d]), away, FORCES)[0] for d in (distance, distance + 0.1))
    np.testing.assert_allclose(near / np.linalg.norm(near), away[0], atol=1e-12)
    assert np.linalg.norm(far) < np.linalg.norm(near)
