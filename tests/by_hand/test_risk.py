"""The risk of a robot beside plain formulas: interpolated forecasts, overlaps, who is near, all people."""

import math
from statistics import NormalDist

import numpy as np
import pytest

from pedpred.driving.risk import Expected, Steps, contact_m, expected, overlap, risk_at, within_reach
from pedpred.scenes import Forecast, Predictions

R_M, PHI = 0.6, NormalDist().cdf


def rectangle(mu, covariance, radius_m=R_M):
    """[Phi((R - d) / sigma) - Phi((-R - d) / sigma)] [Phi((h - m) / s) - Phi((-h - m) / s)], h = pi R / 4.

    sigma is the deviation along the line to mu, at d; m and s are mean and deviation across, given that the
    coordinate along is min(d, R): m = C_12 / C_11 (min(d, R) - d), s^2 = C_22 - C_12^2 / C_11.
    """
    d = math.hypot(*mu)
    along = np.array(mu) / d if d else np.array([1.0, 0.0])
    turn = np.array([along, [-along[1], along[0]]])
    ((c11, c12), (_, c22)) = turn @ np.array(covariance) @ turn.T
    m, s, sigma = c12 / c11 * (min(d, radius_m) - d), math.sqrt(c22 - c12**2 / c11), math.sqrt(c11)
    h = math.pi * radius_m / 4
    first = PHI((radius_m - d) / sigma) - PHI((-radius_m - d) / sigma)
    return first * (PHI((h - m) / s) - PHI((-h - m) / s))


@pytest.mark.parametrize("mu", [(0.9, 0.5), (-0.4, 0.2), (0.3, -0.8), (-0.7, -0.6), (0.0, 0.0), (0.0, 0.31)])
@pytest.mark.parametrize("spread", [(0.09, 0.05, 0.16), (0.5, -0.2, 0.11), (0.02, 0.0, 0.3)])
def test_an_overlap_is_the_probability_of_a_rectangle(mu, spread):
    xx, xy, yy = spread
    for radius_m in (R_M, 0.35):
        expected_p = rectangle(mu, [[xx, xy], [xy, yy]], radius_m)
        assert overlap(*mu, xx, xy, yy, radius_m) == pytest.approx(expected_p, abs=1e-12)


def test_discs_touch_at_the_sum_of_their_radii():
    """People have a radius of 0.3 m."""
    assert contact_m(0.25) == pytest.approx(0.55)
    assert contact_m(0.4) == pytest.approx(0.7)


# Where people are expected

POINT = np.array([[[0.5, 1.0], [1.1, 1.3], [1.4, 2.2]], [[-2.0, 0.3], [-2.5, 0.1], [-3.6, 0.4]]])
PATH = np.stack([POINT + 0.1, POINT * [1.3, 0.7], POINT - [0.4, 0.9]], axis=1)
WEIGHT = np.array([[0.5, 0.3, 0.2], [0.6, 0.25, 0.15]], np.float32)
VELOCITY = np.array([[[0.8, -0.6]] * 3, [[-0.3, 1.2]] * 3]) * [[[1.0], [2.0], [3.0]]]
GROWTH = np.arange(1.0, 4.0) * np.array([[1.0, 1.4, 0.6], [0.9, 2.0, 1.1]])[..., None]
COVARIANCE = GROWTH[..., None, None] * np.array([[0.05, 0.02], [0.02, 0.11]])


def forecast(dt_s, covariance=COVARIANCE, path=PATH):
    predictions = Predictions(POINT, path, WEIGHT, dt_s, covariance)
    return Forecast(0.0, np.arange(2), VELOCITY, predictions)


@pytest.mark.parametrize(
    ("dt_s", "steps"), [(0.3, Steps(0.1, 12)), (0.4, Steps(0.25, 7)), (0.4, Steps(0.5, 2))]
)
def test_forecasts_are_linear_between_their_steps(dt_s, steps):
    """From the present, the first point less dt times its velocity, to the last step; there they stay.

    The present has the variance of the detections; all have 0.1 mm more, and end at 4 deviations.
    """
    found, at_s = expected(forecast(dt_s), steps, 0.3), steps.dt_s * np.arange(1, steps.count + 1)
    for n, k in np.ndindex(2, 3):
        here = POINT[n, 0] - dt_s * VELOCITY[n, 0]
        path, own = np.array([here, *PATH[n, k]]), np.array([0.09 * np.eye(2), *COVARIANCE[n, k]])
        times = dt_s * np.arange(4)
        mean = np.stack([np.interp(at_s, times, path[:, i]) for i in (0, 1)], axis=-1)
        np.testing.assert_allclose(found.mean[n, k], mean, atol=1e-9)
        xx, xy, yy = (np.interp(at_s, times, own[:, i, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
        np.testing.assert_allclose(
            found.covariance[n, k], np.stack([xx + 1e-8, xy, yy + 1e-8], -1), atol=1e-12
        )
        widest = np.linalg.eigvalsh(np.moveaxis(np.array([[xx, xy], [xy, yy]]), -1, 0))[:, -1]
        np.testing.assert_allclose(found.far_m[n, k], 4 * np.sqrt(widest + 1e-8), rtol=1e-9)
    np.testing.assert_allclose(found.weight, WEIGHT, atol=1e-7)


def test_without_covariance_everybody_is_exact():
    found = expected(forecast(0.3, None), Steps(0.1, 5), 0.3)
    np.testing.assert_allclose(found.covariance, np.broadcast_to([1e-8, 0.0, 1e-8], (2, 3, 5, 3)), rtol=1e-9)
    np.testing.assert_allclose(found.far_m, 4e-4, rtol=1e-9)


@pytest.mark.parametrize("dt_s", [0.1, 0.15])
def test_who_leaves_is_there_until_its_last_step(dt_s):
    """Known until 0.3 s; 3 x 0.1 s is a little more than 0.3 s in floating point."""
    gone = PATH.copy()
    gone[1, :, 1:] = np.nan
    found = expected(forecast(0.3, path=gone), Steps(dt_s, 6), 0.3)
    there = np.isfinite(found.mean[1, :, :, 0])
    assert there.tolist() == [[step * dt_s < 0.3001 for step in range(1, 7)]] * 3
    assert np.isfinite(found.mean[0]).all()
    np.testing.assert_allclose(found.mean[1, :, round(0.3 / dt_s) - 1], PATH[1, :, 0])


# All of them


def people_at(mean, weight, covariance=(0.04, 0.01, 0.09), far_m=9.0):
    """People with these modes; mean: [N, K, S, 2], weight: [N, K]."""
    mean = np.array(mean, float)
    spread = np.ascontiguousarray(np.broadcast_to(covariance, (*mean.shape[:3], 3)))
    far = np.ascontiguousarray(np.broadcast_to(far_m, mean.shape[:3]))
    return Expected(mean, spread, far, np.array(weight, float))


def risks(people, step=1, robot=(0.2, -0.1), moved=(0.06, 0.08)):
    """Of overlapping anybody, and somebody whom the robot drives towards."""
    near = within_reach(people, *robot, 100.0, 0.1, R_M)
    return risk_at(step, *robot, *moved, people, near, R_M)


@pytest.mark.parametrize("share", [0.9999, 1.0001])
def test_a_robot_reaches_as_far_as_its_speed_lets_it(share):
    """R + far + (s + 1) dt v, with a far_m of each person, mode and step: 0.6 + far + (s + 1) 0.4 x 1.1."""
    far = np.array([[[0.2, 0.5, 0.1], [0.7, 0.3, 0.4]], [[1.1, 0.6, 0.8], [0.9, 0.15, 0.25]]])
    reach = 0.6 + far + np.array([0.44, 0.88, 1.32])
    factor = np.full((2, 2, 3), 0.9)
    factor[0, 1, 0] = factor[1, 0, 2] = factor[1, 1, 1] = share
    factor[0, 0, 1] = factor[1, 0, 0] = 1.5
    mean = np.array([-1.0, 2.0]) + (factor * reach)[..., None] * [0.6, -0.8]
    mean[1, 1, 2] = np.nan
    count, pairs = within_reach(people_at(mean, np.ones((2, 2)), far_m=far), -1.0, 2.0, 1.1, 0.4, R_M)
    found = [[tuple(pair) for pair in pairs[s, : count[s]].tolist()] for s in range(3)]
    at_limit = share < 1
    assert found[0] == [(0, 0), *([(0, 1)] * at_limit), (1, 1)]
    assert found[1] == [(0, 1), (1, 0), *([(1, 1)] * at_limit)]
    assert found[2] == [(0, 0), (0, 1), *([(1, 0)] * at_limit)]


MEANS = np.array(
    [
        [[[0.6, 0.8], [0.5, 0.7]], [[0.3, 1.4], [-0.3, 0.9]], [[1.2, 0.1], [0.9, 0.2]]],
        [[[0.1, 1.2], [0.3, 0.5]], [[1.1, 0.7], [0.8, 0.4]], [[2.0, 0.4], [1.3, 0.9]]],
        [[[1.3, 0.4], [1.0, 0.3]], [[0.5, 1.3], [0.3, 0.8]], [[0.1, 1.0], [0.3, 0.2]]],
    ]
)
"""Three people with three modes at two steps, all ahead of the robot."""
SHARES = [[0.6, 0.3, 0.1], [0.5, 0.3, 0.2], [0.45, 0.35, 0.2]]


def test_nobody_is_no_risk():
    assert risks(people_at(np.zeros((0, 3, 2, 2)), np.zeros((0, 3)))) == (0.0, 0.0)
    assert risks(people_at(np.full((2, 3, 2, 2), np.nan), SHARES[:2])) == (0.0, 0.0)


@pytest.mark.parametrize("others", [0, 1, 2])
def test_a_risk_is_at_most_1(others):
    """Weights may sum to more than 1 by rounding; everybody is surely overlapped."""
    mean = np.full((1 + others, 2, 2, 2), [0.25, 0.0])
    weight = np.full((1 + others, 2), [0.7, 0.3 + 1e-7])
    assert risks(people_at(mean, weight, (1e-4, 0.0, 1e-4))) == (1.0, 1.0)
    weight[-1] = 0.25
    found = risks(people_at(mean, weight, (1e-4, 0.0, 1e-4)))
    assert found == ((1.0, 1.0) if others else pytest.approx((0.5, 0.5)))


def test_nobody_is_expected_beyond_its_own_distance():
    """At 0.6 m + far_m from the robot; there the rectangle still has a probability."""
    at = np.array([0.2, -0.1]) + 0.9 * np.array([0.6, 0.8])
    for far_m, felt in ((0.3001, True), (0.2999, False)):
        found = risks(people_at(np.full((1, 1, 2, 2), at), [[1.0]], far_m=far_m))
        assert (found[0] > 0.01, found[1] > 0.01) == (felt, felt)


NORTH_EAST = math.atan2(0.8, 0.6)


def around(cosine, distance_m, side=1.0):
    """A place at a distance whose direction has a cosine with (0.6, 0.8)."""
    angle = NORTH_EAST + side * math.acos(cosine)
    return distance_m * np.array([math.cos(angle), math.sin(angle)])


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("now", "before", "counts"),
    [
        (0.9, 0.9, True),
        (-0.28, -0.28, True),
        (-0.32, -0.32, False),
        (-0.9, -0.9, False),
        (-0.32, -0.28, True),  # a runner whom the robot has met within the step
        (-0.9, 0.5, True),
        (-0.28, -0.32, True),  # who overtakes the robot is beside it
        (0.9, -0.9, True),
    ],
)
def test_who_is_behind_now_and_was_before_is_not_driven_towards(now, before, counts, side):
    """Behind: the cosine with the way is below -0.3, from where the robot is, and from where it was."""
    robot, moved = np.array([0.2, -0.1]), 0.1 * np.array([0.6, 0.8])
    places = [around(-before, 0.8) - moved, around(before, 0.8, side) - moved, around(now, 0.7, side)]
    anybody, ahead = risks(people_at((robot + places)[None, None], [[1.0]]), 2, robot, moved)
    assert anybody == pytest.approx(rectangle(around(now, 0.7, side), [[0.04, 0.01], [0.01, 0.09]]))
    assert ahead == pytest.approx(anybody * counts)
    assert anybody > 0.05


def test_only_the_modes_ahead_are_driven_towards():
    """Of two people, each with a mode ahead and one behind; and the last one is behind alone."""
    robot = np.array([0.2, -0.1])
    places = [
        [around(0.8, 0.6), around(-0.7, 0.5)],
        [around(-0.6, 0.7), around(0.3, 0.8)],
        [around(-0.9, 0.4)] * 2,
    ]
    mean = robot + np.repeat(np.array(places)[:, :, None], 2, axis=2)
    weight = np.array([[0.6, 0.4], [0.7, 0.3], [0.8, 0.2]])
    p = np.array([[rectangle(at, [[0.04, 0.01], [0.01, 0.09]]) for at in one] for one in places])
    towards = np.array([[True, False], [False, True], [False, False]])
    found = risks(people_at(mean, weight), 1, robot, 0.1 * np.array([0.6, 0.8]))
    everybody, those = (1.0 - (1.0 - (weight * p * who).sum(axis=1)).prod() for who in (1.0, towards))
    assert found == pytest.approx((everybody, those), abs=1e-12)


def test_before_the_first_step_people_are_where_it_ends():
    """The mean of the second step, which is ahead, does not matter to the first."""
    robot, moved = np.array([0.2, -0.1]), 0.1 * np.array([0.6, 0.8])
    mean = np.array([[[robot + around(-0.9, 0.7), robot + around(0.9, 0.7)]]])
    anybody, ahead = risks(people_at(mean, [[1.0]]), 0, robot, moved)
    assert anybody > 0.05
    assert ahead == 0.0


def test_a_robot_that_stands_drives_towards_nobody():
    anybody, ahead = risks(people_at(MEANS, SHARES), 1, moved=(0.0, 0.0))
    assert anybody > 0.5
    assert ahead == 0.0
