"""How robots move, and the manoeuvres that they are offered: numbers by hand."""

import math

import numpy as np
import pytest

from pedpred.driving.robot import advance
from tests.by_hand.robots import HOLONOMIC, ROBOT


@pytest.mark.parametrize("dt_s", [0.1, 0.4])
@pytest.mark.parametrize(
    ("asked", "got"),
    [
        ((0.55, 0.35), lambda dt_s: (0.5 + min(0.05, 0.9 * dt_s), 0.3 + 0.05)),
        ((3.0, 0.3), lambda dt_s: (0.5 + 0.9 * dt_s, 0.3)),
        ((-2.0, 0.3), lambda dt_s: (0.5 - 1.6 * dt_s, 0.3)),
        ((0.5, 9.0), lambda dt_s: (0.5, 0.3 + 2.3 * dt_s)),
        ((0.5, -9.0), lambda dt_s: (0.5, 0.3 - 2.3 * dt_s)),
    ],
)
def test_a_differential_robot_moves_along_the_middle_heading(asked, got, dt_s):
    """a and b change by at most 0.9 (1.6 to slow down) and 2.3 per second; the step has their means."""
    a, b = got(dt_s)
    speed, turn = (0.5 + a) / 2, (0.3 + b) / 2
    x = 1.0 + speed * math.cos(0.8 + turn * dt_s / 2) * dt_s
    y = -2.0 + speed * math.sin(0.8 + turn * dt_s / 2) * dt_s
    found = advance((1.0, -2.0, 0.8, 0.5, 0.3), *asked, ROBOT.limits, dt_s)
    assert found == pytest.approx((x, y, 0.8 + turn * dt_s, a, b))


@pytest.mark.parametrize("dt_s", [0.1, 0.4])
@pytest.mark.parametrize(
    ("asked", "rate"),
    [((4.3, -3.4), 0.9), ((-3.7, 2.6), 0.9), ((0.02, -0.01), 1.6), ((0.4, 0.3), 1.6), ((0.31, -0.41), 0.9)],
)
def test_a_holonomic_robot_changes_velocity_along_a_line(asked, rate, dt_s):
    """By at most 0.9 dt to become faster than 0.5 m/s, else by 1.6 dt; the place follows the mean."""
    v, to = np.array([0.3, -0.4]), np.subtract(asked, (0.3, -0.4))
    new = v + to * min(1.0, rate * dt_s / math.hypot(*to))
    found = advance((1.0, -2.0, 0.8, *v.tolist()), *asked, HOLONOMIC.limits, dt_s)
    assert found == pytest.approx((*(np.array([1.0, -2.0]) + dt_s * (v + new) / 2), 0.8, *new))


def test_differential_manoeuvres_are_pairs_of_turns():
    """A speed v and a turn w, then w, -w or 0, or braking; or w on the spot, then straight at half speed."""
    turns = [sign * share * 1.7 for share in (0.0, 0.15, 0.35, 0.65, 1.0) for sign in (-1, 1)]
    once = [(v * 1.1, w) for v in (0.25, 0.5, 0.75, 1.0) for w in turns]
    pairs = {(c, (c[0], side * c[1])) for c in once for side in (1, 0, -1)}
    pairs |= {((0.0, w), (0.55, 0.0)) for w in turns}
    offered = ROBOT.manoeuvres(0.7, 9, 2, 5)
    expected_set = {(c, then) for c, then in pairs} | {(c, (0.0, 0.0)) for c, _ in pairs}
    found = {(tuple(np.round(c[1], 9)), tuple(np.round(c[2], 9))) for c in offered + 0.0}
    assert found == {tuple(tuple(np.round(np.array(one) + 0.0, 9)) for one in pair) for pair in expected_set}
    for c in offered:
        np.testing.assert_array_equal(c, [c[1]] * 2 + [c[2]] * 3 + [[0.0, 0.0]] * 4)
    assert not offered[0].any()


def test_holonomic_manoeuvres_have_16_directions():
    angles, speeds = 0.7 + np.arange(16) * math.pi / 8, 1.1 * np.array([0.25, 0.5, 0.75, 1.0])
    once = {(round(v * math.cos(a), 6), round(v * math.sin(a), 6)) for a in angles for v in speeds}
    ahead = (round(1.1 * math.cos(0.7), 6), round(1.1 * math.sin(0.7), 6))
    wanted = {(c, then) for c in once for then in (c, ahead, (0.0, 0.0))} | {((0.0, 0.0), (0.0, 0.0))}
    offered = HOLONOMIC.manoeuvres(0.7, 9, 2, 5)
    assert {tuple(tuple(one) for one in np.round(c[[1, 2]], 6)) for c in offered} == wanted
    assert not offered[:, 5:].any()
