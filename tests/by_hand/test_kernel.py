"""Forces of the kernel beside plain formulas: Helbing & Molnar 1995, groups of Moussaid et al. 2010."""

import math

import numpy as np
import pytest

from pedpred.simulation.kernel import accelerations, accompany, interaction_range_m
from pedpred.simulation.physics import border, way
from pedpred.simulation.routing import Routes
from tests.by_hand.grounds import FORCES, OPEN, ground_of

ORIGIN, CELL_M = np.array([-1.3, 0.7]), 0.25
FIELD = np.array(
    [
        [[3.1, 0.2, 0.5], [1.4, -0.3, 0.9], [4.1, 0.8, 0.1]],
        [[0.9, 0.7, -0.6], [0.2, 0.4, 0.3], [0.5, -0.5, 0.7]],
        [[2.6, -0.2, 0.6], [0.3, 0.9, -0.4], [0.8, 0.1, -0.8]],
        [[3.5, 0.6, 0.2], [0.7, 0.5, 0.5], [2.9, -0.9, 0.4]],
    ]
)
"""Distance to an obstacle and its gradient in 4 x 3 cells; irregular, so that no two are mixed up."""


def at(field, x, y):
    """Linear along one axis, then along the other, between centres; constant beyond the outermost ones."""
    u, v = (x - ORIGIN[0]) / CELL_M - 0.5, (y - ORIGIN[1]) / CELL_M - 0.5
    rows, columns = np.arange(field.shape[0]), np.arange(field.shape[1])
    return np.interp(u, rows, [np.interp(v, columns, row) for row in field])


# Fields


def test_fields_are_linear_between_centres_of_cells():
    for x, y in (
        *((-0.9, 1.07), (-0.62, 1.13), (-0.45, 1.29), (-2.0, 1.1)),
        *((4.0, 1.1), (-0.8, -3.0), (-0.8, 9.0), (9.0, 9.0)),
    ):
        expected = [at(FIELD[..., k], x, y) for k in range(3)]
        np.testing.assert_allclose(border(x, y, ground_of(FIELD, ORIGIN, CELL_M)), expected, atol=1e-12)


@pytest.mark.parametrize("part", [FIELD[2:3], FIELD[:, 1:2], FIELD[1:2, 2:3]])
def test_a_field_may_be_one_cell_wide(part):
    expected = [at(part[..., k], -0.83, 1.13) for k in range(3)]
    np.testing.assert_allclose(border(-0.83, 1.13, ground_of(part, ORIGIN, CELL_M)), expected, atol=1e-12)


def test_the_way_is_the_unit_vector_of_the_blended_directions():
    field = np.stack([FIELD[..., :2], FIELD[..., 1:]]).astype(np.float32)
    routes = Routes(np.array([[5.0, 1.0], [-2.0, 3.0]]), ORIGIN, CELL_M, field)
    for goal, (x, y) in ((0, (-0.71, 1.13)), (1, (-0.71, 1.13)), (1, (-0.45, 1.29)), (0, (-0.9, 9.0))):
        blend = np.array([at(field[goal, ..., k], x, y) for k in range(2)])
        np.testing.assert_allclose(way(x, y, goal, routes), blend / np.hypot(*blend), atol=1e-6)


def test_where_no_route_leads_the_way_is_straight():
    """From (0.2, -0.5) to (3.2, 3.5): 3 and 4 of 5 m; at the target itself there is no direction."""
    routes = Routes(np.array([[9.0, 9.0], [3.2, 3.5]]), ORIGIN, CELL_M, np.zeros((2, 4, 3, 2), np.float32))
    assert way(0.2, -0.5, 1, routes) == pytest.approx((0.6, 0.8))
    assert way(3.2, 3.5, 1, routes) == (0.0, 0.0)
    one_axis = Routes(routes.target, ORIGIN, CELL_M, np.full((2, 4, 3, 2), [0.0, -0.3], np.float32))
    assert way(0.2, -0.5, 1, one_axis) == pytest.approx((0.0, -1.0))


# Forces


def drive(v, e, speed):
    """(v0 e - v) / tau. Helbing & Molnar 1995, eq. 2."""
    return (speed * e - v) / FORCES.relaxation_time_s


def wall(x, y):
    """U0 / R exp(-d / R) grad d. Eq. 5."""
    strength = FORCES.border_strength / FORCES.border_range_m
    away = np.array([at(FIELD[..., k], x, y) for k in (1, 2)])
    return strength * math.exp(-at(FIELD[..., 0], x, y) / FORCES.border_range_m) * away


def push(r, y, e, sigma=0.35, least_m=1e-3):
    """w V0 / sigma exp(-b / sigma) (|r| + |r - y|) / (4 b) (r / |r| + (r - y) / |r - y|). Eq. 3, 4, 7, 8.

    2 b = sqrt((|r| + |r - y|)^2 - |y|^2); b, |r| and |r - y| are at least 1 mm in denominators.
    """
    here, there = math.hypot(*r), math.hypot(*(r - y))
    b = max(0.5 * math.sqrt(max((here + there) ** 2 - math.hypot(*y) ** 2, 0.0)), least_m)
    units = r / max(here, least_m) + (r - y) / max(there, least_m)
    f = FORCES.pedestrian_strength / sigma * math.exp(-b / sigma) * (here + there) / (4 * b) * units
    seen = -(e @ f) >= math.hypot(*f) * math.cos(math.radians(100.0))
    return f if seen else 0.5 * f


def strides(velocity, direction):
    return FORCES.anticipation_s * np.linalg.norm(velocity, axis=1)[:, None] * direction


def range_by_hand(longest_m, sigma=0.35):
    """|r| from which on V0 / sigma exp(-b / sigma) < 1e-3 m/s^2, with b >= sqrt(|r| (|r| - s))."""
    b = sigma * math.log(2.3 / sigma / 1e-3)
    return longest_m / 2 + math.sqrt(b**2 + longest_m**2 / 4) + 1e-3


def forces_on(position, velocity, direction, speed, ground, forces=FORCES):
    found = np.empty_like(position)
    accelerations(position, velocity, direction, speed, ground, forces, found)
    return found


def pushes(position, velocity, direction, sigma=0.35):
    """Of all within the range of the longest stride."""
    stride, total = strides(velocity, direction), np.zeros_like(position)
    most = range_by_hand(np.linalg.norm(stride, axis=1).max(), sigma)
    for n in range(len(position)):
        for m in range(len(position)):
            r = position[n] - position[m]
            if m != n and math.hypot(*r) <= most:
                total[n] += push(r, stride[m], direction[n], sigma)
    return total


PEOPLE = (
    np.array([[-0.9, 1.07], [-0.62, 1.31], [-0.41, 0.72]]),
    np.array([[0.9, -0.2], [-0.3, 0.5], [0.1, 1.4]]),
    np.array([[0.6, -0.8], [-0.28, 0.96], [0.0, 1.0]]),
    np.array([1.1, 0.7, 1.5]),
)
"""Position, velocity, direction and speed; they turn, so that velocity and direction differ."""


def test_three_unequal_people_beside_a_wall_feel_all_forces():
    position, velocity, direction, speed = PEOPLE
    expected = pushes(position, velocity, direction)
    for n in range(3):
        expected[n] += drive(velocity[n], direction[n], speed[n]) + wall(*position[n])
    np.testing.assert_allclose(forces_on(*PEOPLE, ground_of(FIELD, ORIGIN, CELL_M)), expected, rtol=1e-9)


@pytest.mark.parametrize(("angle_deg", "weight"), [(98, 1.0), (-98, 1.0), (102, 0.5), (-102, 0.5), (0, 1.0)])
def test_who_is_seen_at_more_than_100_degrees_pushes_half(angle_deg, weight):
    """Somebody who stands at 0.6 m pushes with V0 / sigma exp(-0.6 / sigma), as |r| = b and y = 0."""
    angle = math.radians(30.0 + angle_deg)
    e = np.array([[math.cos(math.radians(30.0)), math.sin(math.radians(30.0))], [1.0, 0.0]])
    to = np.array([math.cos(angle), math.sin(angle)])
    position, velocity = np.array([[0.2, 0.3], [0.2, 0.3] + 0.6 * to]), np.array([1.2 * e[0], [0.0, 0.0]])
    found = forces_on(position, velocity, e, np.array([1.2, 0.0]), OPEN)
    np.testing.assert_allclose(found[0], -weight * 2.3 / 0.35 * math.exp(-0.6 / 0.35) * to, rtol=1e-9)


@pytest.mark.parametrize("r", [(0.3, 0.0), (0.0, 0.0), (4e-4, 3e-4), (0.8, 2e-4), (0.8, 0.0)])
def test_on_the_line_between_the_foci_the_push_has_a_bound(r):
    """b is 1 mm there; the stride of the other is 0.8 m along x."""
    position, velocity = np.array([r, (0.0, 0.0)], float), np.array([[0.0, 0.0], [1.0, 0.0]])
    direction = np.array([[0.6, 0.8], [1.0, 0.0]])
    expected = push(position[0], np.array([0.8, 0.0]), direction[0])
    found = forces_on(position, velocity, direction, np.zeros(2), OPEN)
    np.testing.assert_allclose(found[0], expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("longest_m", [0.0, 0.3, 1.7])
def test_the_range_ends_where_the_push_is_a_thousandth(longest_m):
    assert interaction_range_m(longest_m, FORCES) == pytest.approx(range_by_hand(longest_m), rel=1e-9)
    weak = FORCES._replace(pedestrian_strength=1e-4)  # never as strong: only the ellipse itself is left
    assert interaction_range_m(longest_m, weak) == pytest.approx(longest_m + 1e-3, rel=1e-9)


@pytest.mark.parametrize("sigma", [0.35, 0.04])
@pytest.mark.parametrize("side_m", [(1.0, 3.0), (9.0, 9.0), (0.0, 40.0), (70.0, 0.0), (25.0, 12.0)])
def test_all_within_the_range_push_and_nobody_beyond(side_m, sigma):
    """Whatever the cells that people are sorted into: the sum over all pairs. Ranges of 3.3 and 0.7 m."""
    rng, count = np.random.default_rng(4), 40
    position = np.array([-3.0, -50.0]) + rng.uniform(0.0, 1.0, (count, 2)) * side_m
    angle = rng.uniform(-3, 3, count)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    velocity = rng.uniform(0.1, 0.5, count)[:, None] * direction
    forces = FORCES._replace(pedestrian_range_m=sigma)
    found = forces_on(position, velocity, direction, np.linalg.norm(velocity, axis=1), OPEN, forces)
    np.testing.assert_allclose(found, pushes(position, velocity, direction, sigma), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("longest_m", [0.0, 2.0])
@pytest.mark.parametrize(("share", "felt"), [(0.9999, True), (1.0001, False)])
def test_the_range_is_that_of_the_longest_stride(share, felt, longest_m):
    """The first two stand; a runner far away makes their range longer."""
    apart = share * range_by_hand(longest_m)
    position = np.array([[0.3, 0.1], [0.3 + 0.6 * apart, 0.1 + 0.8 * apart], [90.0, 0.0]])
    velocity = np.array([[0.0, 0.0], [0.0, 0.0], [0.6, 0.8]]) * longest_m / 0.8
    found = forces_on(position, velocity, np.array([[1.0, 0.0]] * 3), np.zeros(3), OPEN)
    assert np.hypot(*found[0]) == pytest.approx(2.3 / 0.35 * math.exp(-apart / 0.35) * felt, rel=1e-9)


# Groups

MEMBERS = np.array([[0.0, 0.0], [0.5, 0.3], [-1.1, 2.4], [0.1, -0.2], [0.2, 0.4], [-0.47, 0.93], [1.3, 0.9]])
GROUP = np.array([7, 7, 7, -1, 2, 2, 4])


def together(n, position, velocity, e):
    """Moussaid et al. 2010, eq. 6: gaze, attraction to the centre, repulsion by members within d0.

    -beta_1 alpha v + q_A beta_2 U + beta_3 sum q_R W, with the angle alpha by which the head has to turn
    beyond 90 degrees, U to the centre of the group, which is far if beyond (size - 1) / 2 m, W away
    from the others.
    """
    others = [m for m in range(len(position)) if GROUP[m] == GROUP[n] and m != n]
    centre = position[[n, *others]].mean(axis=0) - position[n]
    away = [position[n] - position[m] for m in others]
    near = sum((a / math.hypot(*a) for a in away if math.hypot(*a) < 0.8), np.zeros(2))
    u = centre / math.hypot(*centre)
    alpha = max(math.acos(min(max(e @ u, -1.0), 1.0)) - math.pi / 2, 0.0)
    return 3.0 * u * (math.hypot(*centre) > len(others) / 2) + 1.7 * near - 4.0 * alpha * velocity


@pytest.mark.parametrize("e", [(0.6, 0.8), (-0.28, 0.96), (0.8, -0.6), (-0.96, -0.28)])
@pytest.mark.parametrize("n", [0, 1, 2, 4, 5])
def test_a_group_attracts_repels_and_looks_at_itself(n, e):
    """Of the second group, which is 0.85 m apart, nobody is far and nobody near."""
    velocity, direction = np.array([[0.9, -0.3]] * 7) * (1 + n), np.array([e] * 7)
    found = accompany(n, MEMBERS, velocity, direction, GROUP, FORCES)
    np.testing.assert_allclose(found, together(n, MEMBERS, velocity[n], np.array(e)), rtol=1e-9)


@pytest.mark.parametrize(
    ("to", "near", "far"),
    [((0.7, 0.45), 0, 0), ((0.62, -0.45), 1, 0), ((0.9, 0.5), 0, 1), ((1.07, 0.0), 0, 1)],
)
def test_two_are_near_within_0_8_m_and_far_beyond_1_m(to, near, far):
    """0.83, 0.77, 1.03 and 1.07 m; the centre of two is half as far, and far beyond 0.5 m."""
    position, e, u = np.array([[0.2, 0.1], np.add((0.2, 0.1), to)]), np.array([[1.0, 0.0]] * 2), np.array(to)
    found = accompany(0, position, e, e, np.array([3, 3]), FORCES)
    np.testing.assert_allclose(found, (3.0 * far - 1.7 * near) * u / np.hypot(*u), atol=1e-9)


def test_who_has_lost_its_group_feels_none():
    e = np.array([[-1.0, 0.0]] * 7)
    assert accompany(6, MEMBERS, e, e, GROUP, FORCES) == (0.0, 0.0)
    assert accompany(0, MEMBERS[:1], e[:1], e[:1], GROUP[:1], FORCES) == (0.0, 0.0)


@pytest.mark.parametrize(("ahead", "turned"), [(1.0 + 1e-9, 0.0), (-1.0 - 1e-9, math.pi / 2)])
def test_who_looks_straight_at_the_group_or_away_has_an_angle(ahead, turned):
    """Rounding may make the direction longer than 1. The other is 0.9 m ahead: neither far nor near."""
    position, v = np.array([[0.0, 0.0], [0.9, 0.0]]), np.array([[0.5, 0.2]] * 2)
    e = np.array([[ahead, 0.0]] * 2)
    found = accompany(0, position, v, e, np.array([3, 3]), FORCES)
    np.testing.assert_allclose(found, -4.0 * turned * np.array([0.5, 0.2]), atol=1e-6)
