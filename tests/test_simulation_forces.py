"""Laws of the social forces of the compiled kernel (Helbing & Molnar 1995)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.geometry import rotate
from pedpred.simulation.ground import signed_distance
from pedpred.simulation.kernel import accelerations
from tests.by_hand.grounds import FORCES, OPEN

BLIND = FORCES._replace(unseen_weight=1.0)  # without anisotropy


def pushes(position, velocity):
    """Forces on people who walk at their desired velocity, far from obstacles. [N, 2]."""
    speed, found = np.linalg.norm(velocity, axis=-1), np.empty_like(position)
    direction = velocity / np.maximum(speed, 1e-12)[:, None]
    accelerations(position, velocity, direction, speed, OPEN, BLIND, found)
    return found


@pytest.mark.parametrize("gap_m", [0.4, 1.0, 2.0])
def test_equal_people_push_each_other_equally(gap_m):
    one, other = pushes(np.array([[0.0, 0.0], [gap_m, 0.3]]), np.array([[1.2, 0.1], [-1.2, -0.1]]))
    assert np.linalg.norm(one) > 1e-6
    np.testing.assert_allclose(one, -other, atol=1e-12)


@given(st.integers(0, 10_000))
def test_a_push_is_minus_the_gradient_of_its_potential(seed):
    """V(b) = V0 exp(-b / sigma) with 2 b = sqrt((|r| + |r - y|)^2 - |y|^2), eq. 3, 4 and 13."""
    rng = np.random.default_rng(seed)
    r, velocity = (
        rng.uniform(0.4, 1.5) * rng.choice([-1, 1], 2),
        np.stack([np.zeros(2), rng.normal(0, 0.6, 2)]),
    )
    y = FORCES.anticipation_s * velocity[1]

    def axis(at):
        return 0.5 * np.sqrt((np.linalg.norm(at) + np.linalg.norm(at - y)) ** 2 - y @ y)

    def potential(at):
        return FORCES.pedestrian_strength * np.exp(-axis(at) / FORCES.pedestrian_range_m)

    if axis(r) > 0.05:  # the potential has a ridge between the foci
        slope = [(potential(r + h) - potential(r - h)) / 2e-6 for h in 1e-6 * np.eye(2)]
        found = pushes(np.stack([r, np.zeros(2)]), velocity)[0]
        np.testing.assert_allclose(found, -np.array(slope), atol=1e-5, rtol=1e-5)


@given(st.integers(0, 10_000), st.floats(-3.1, 3.1), st.floats(-50.0, 50.0))
def test_forces_turn_and_move_with_the_crowd(seed, angle, shift_m):
    rng = np.random.default_rng(seed)
    position, velocity = rng.normal(0.0, 1.5, (6, 2)), rng.normal(0.0, 1.0, (6, 2))
    moved = pushes(rotate(position, angle) + shift_m, rotate(velocity, angle))
    np.testing.assert_allclose(moved, rotate(pushes(position, velocity), angle), atol=1e-8)


def test_signed_distance_is_exact_along_straight_borders():
    occupied = np.zeros((20, 10), dtype=bool)
    occupied[:5] = True
    np.testing.assert_allclose(signed_distance(occupied, 0.1)[:, 3], 0.1 * (np.arange(20) + 0.5) - 0.5)
