"""Comparisons of earlier forecasts with detections: where people were, and what errors teach, by hand."""

import numpy as np
import pytest

from pedpred.forecasting.detections import Detections, is_in_sorted
from pedpred.forecasting.groups import STILL, STIRRING, WALKING, groups_of, is_faster_mode
from pedpred.forecasting.regions import (
    Adjustment,
    PendingForecast,
    compare_with_detections,
    widen_covariances,
)
from pedpred.metrics.calibration import COARSE, REGIONS, share_inside
from pedpred.scenes import Predictions

KNOWN = Detections(
    np.array([0.0, 0.4, 1.3, 2.4, 3.4, 0.2, 0.6, 1.6]),
    np.array([2, 2, 2, 2, 2, 5, 5, 5]),
    np.array([[1, 2], [3, 1], [6, 4], [7, 9], [9, 5], [-4, 0], [-8, 2], [-9, 8]], np.float64),
)


@pytest.mark.parametrize(
    ("person", "time_s", "expected", "noise"),
    [
        (2, 0.1, [1.5, 1.75], 0.5625 + 0.0625),  # variance of an interpolated position: (1 - s)^2 + s^2
        (2, 1.0, [5.0, 3.0], 1 / 9 + 4 / 9),
        (2, 0.4, [3.0, 1.0], 1.0),
        (2, 0.0, [1.0, 2.0], 1.0),
        (2, 3.4, [9.0, 5.0], 1.0),
        (2, 2.65, [7.5, 8.0], 0.5625 + 0.0625),  # detections 1 s apart
        (2, 1.9, None, 1.0),  # 1.1 s apart
        (2, -0.1, None, 1.0),  # before the first and after the last detection
        (2, 3.5, None, 1.0),
        (5, 0.1, None, 1.0),
        (5, 0.5, [-7.0, 1.5], 1 / 16 + 9 / 16),
        (5, 1.6, [-9.0, 8.0], 1.0),
        (3, 0.4, None, 1.0),
    ],
)
def test_positions_between_detections_are_interpolated(person, time_s, expected, noise):
    """Where they are at most 1 s apart."""
    found, variance = KNOWN.at(np.array([person]), np.array([time_s]))
    np.testing.assert_allclose(found, [[np.nan, np.nan] if expected is None else expected], atol=1e-12)
    np.testing.assert_allclose(variance, [noise])


def test_rounding_of_times_loses_no_detection():
    """Times that differ by less than 1e-6 s are the same; so are gaps of 1 s, and 0.2 s before and after."""
    off_s = 5e-7
    found, _ = KNOWN.at(np.array([2, 2]), np.array([3.4 + off_s, 2.4 - off_s]))
    np.testing.assert_allclose(found, [[9.0, 5.0], [7.0, 9.0]], atol=1e-5)
    gap = Detections(np.array([0.0, 1.0 + off_s]), np.array([1, 1]), np.array([[0.0, 0.0], [4.0, 8.0]]))
    np.testing.assert_allclose(gap.at(np.array([1]), np.array([0.25]))[0], [[1.0, 2.0]], atol=1e-5)
    time_s = np.array([-0.2 - off_s, 0.0, 0.2 + off_s])
    near = Detections(time_s, np.ones(3, int), np.diag([1.0, 3.0, 9.0])[:, :2].copy())
    found, noise = near.at(np.array([1]), np.array([0.0]))
    np.testing.assert_allclose(found, [[1 / 3, 1.0]], atol=1e-5)
    np.testing.assert_allclose(noise, 1 / 3, atol=1e-5)


@pytest.mark.parametrize(
    "time_s", [[1.0, 1.1, 1.25], [0.9, 1.0, 1.2, 1.3], [0.9, 0.95, 1.02, 1.2], [0.4, 0.95, 1.02, 1.2]]
)
def test_a_line_through_three_near_detections_is_less_noisy(time_s):
    """At 1.1 s, of n detections within 0.2 s: its variance is 1 / n + (1.1 - mean)^2 / sum (t_k - mean)^2."""
    time_s, rng = np.array(time_s), np.random.default_rng(2)
    position = rng.normal([30.0, -4.0], 0.2, (len(time_s), 2))
    found, noise = Detections(time_s, np.full(len(time_s), 3), position).at(np.array([3]), np.array([1.1]))
    near = np.abs(time_s - 1.1) < 0.2 + 1e-9
    np.testing.assert_allclose(found[0], np.polyfit(time_s[near] - 1.1, position[near], 1)[1])
    away_s = time_s[near] - time_s[near].mean()
    off_s = 1.1 - time_s[near].mean()
    np.testing.assert_allclose(noise, 1 / near.sum() + off_s**2 / (away_s**2).sum())


@pytest.mark.parametrize(
    ("time_s", "share"),
    [([0.89, 1.0, 1.25, 1.6], 0.1 / 0.25), ([0.9, 0.91, 0.92, 1.4], 0.18 / 0.48)],
)
def test_a_noisier_line_is_not_used(time_s, share):
    """At 1.1 s, through two detections within 0.2 s, or three that are all before."""
    position = np.random.default_rng(2).normal([30.0, -4.0], 0.2, (4, 2))
    found, noise = Detections(np.array(time_s), np.full(4, 3), position).at(np.array([3]), np.array([1.1]))
    np.testing.assert_allclose(found[0], [np.interp(1.1, time_s, axis) for axis in position.T])
    np.testing.assert_allclose(noise, (1 - share) ** 2 + share**2)


def test_detections_are_kept_from_an_instant_on():
    """Sorted by person and time; those at the instant itself are kept."""
    later = KNOWN.append(3.5, np.array([5, 1]), np.array([[1.0, 2.0], [3.0, 4.0]]))
    np.testing.assert_array_equal(later.person, [1, 2, 2, 2, 2, 2, 5, 5, 5, 5])
    np.testing.assert_array_equal(later.time_s, [3.5, 0.0, 0.4, 1.3, 2.4, 3.4, 0.2, 0.6, 1.6, 3.5])
    np.testing.assert_array_equal(later.position[[0, 9]], [[3.0, 4.0], [1.0, 2.0]])
    late = later.since(1.3)
    np.testing.assert_array_equal(late.person, [1, 2, 2, 2, 5, 5])
    np.testing.assert_array_equal(late.time_s, [3.5, 1.3, 2.4, 3.4, 1.6, 3.5])
    np.testing.assert_array_equal(late.position[1], [6.0, 4.0])


def test_people_forecast_to_go_0_3_mps_walk():
    """At least 0.36 m, 0.3 m/s times (P - 1) dt, of four steps of 0.4 s; who stirs goes 0.06 m."""
    ways = [[0.36, 0.0], [0.0, -0.37], [0.22, 0.29], [0.35, 0.0], [0.2, 0.2], [0.0, 0.061], [-0.059, 0.0]]
    point = np.zeros((7, 4, 2))
    point[:, 0], point[:, 1:3] = [7.0, -3.0], 50.0
    point[:, 3] = point[:, 0] + np.array(ways) * (1.0 + 1e-9)
    found = groups_of(Predictions.single(point, 0.4))
    np.testing.assert_array_equal(found, [WALKING] * 3 + [STIRRING] * 3 + [STILL])


def test_the_mean_speed_over_the_modes_counts():
    """0.7 x 0.04 + 0.3 x 0.2 = 0.088 m/s and 0.9 x 0.04 + 0.1 x 0.2 = 0.056, not 0.95 x 0.02 + 0.05 x 0.4."""
    speed = np.array([[0.04, 0.2], [0.04, 0.2], [0.02, 0.4], [0.5, 0.1], [0.1, 0.5]])
    path = np.array([3.0, 1.0]) + speed[:, :, None, None] * 0.4 * np.arange(4)[:, None] * [0.6, -0.8]
    weight = np.array([[0.7, 0.3], [0.9, 0.1], [0.95, 0.05], [0.8, 0.2], [0.9, 0.1]])
    found = Predictions(path[:, 0], path, weight, 0.4)
    np.testing.assert_array_equal(groups_of(found), [STIRRING, STIRRING, STILL, WALKING, STIRRING])
    faster = is_faster_mode(found)
    np.testing.assert_array_equal(faster[:, 0], [False] * 5)
    np.testing.assert_array_equal(faster[:, 1], [False, False, True, False, True])


def test_values_are_found_among_rising_ones():
    found = is_in_sorted(np.array([2, 2, 5, 9]), np.array([9, 1, 2, 5, 6, 10]))
    np.testing.assert_array_equal(found, [True, False, True, True, False, False])


def pending(path, covariance, weight, **given):
    """Forecasts of people 0, 1, ... at one step, compared with detections at 3 s."""
    rows = len(path)
    usual = {"due_s": 3.2, "until_s": 7.0, "step": 0, "person": np.arange(rows)}
    usual |= {"forecast": 10 + np.arange(rows), "group": np.zeros(rows, int), "learned": np.zeros((2, 2))}
    return PendingForecast(path=path, covariance=covariance, weight=weight, **usual | given)


def single(away_m, deviation_m=1.0, **given):
    """Forecasts of one mode, from which people are so far away; and where these are. World frame."""
    away_m = np.asarray(away_m)
    there = np.array([40.0, -7.0]) + np.stack([0.6 * away_m, -0.8 * away_m], axis=-1)
    path = np.tile([40.0, -7.0], (len(away_m), 1, 1))
    sigma = np.broadcast_to(deviation_m**2 * np.eye(2), (len(away_m), 1, 2, 2))
    past = pending(path, sigma, np.ones((len(away_m), 1)), **given)
    return past, Detections(np.full(len(away_m), 3.0), np.arange(len(away_m)), there)


def away(u):
    """How far the boundary of a region of a plane Gaussian is away: u = 1 - exp(-r^2 / 2)."""
    return np.sqrt(-2 * np.log1p(-np.asarray(u)))


def taught_by(u, gain):
    """g (z50 + z90 + z95) / 3, g / 2 ((z90 + z95) / 2 - z50); z_l = ([u > l] - (1 - l)) / sqrt(l (1 - l))."""
    z50, z90, z95 = ((u > level) - (1 - level) for level in (0.5, 0.9, 0.95))
    z50, z90, z95 = z50 / 0.5, z90 / 0.3, z95 / 0.0475**0.5
    return np.array([gain * (z50 + z90 + z95) / 3, gain / 2 * ((z90 + z95) / 2 - z50)])


NONE = np.zeros(0, np.int64)
U = np.array([0.01, 0.499, 0.501, 0.899, 0.901, 0.949, 0.951, 0.999])


def test_later_steps_of_lost_forecasts_are_left_out():
    """Forecasts 10 and 11 are of people 0 and 1, 12 of one who is not detected; 9 and 13 are of others."""
    past, known = single(away([0.3, 0.6, 0.96]), person=np.array([0, 1, 60]))
    taught, gone = compare_with_detections(
        [past], np.array([9, 10, 12]), known, np.zeros((2, 2, 1)), 0.0, 1.0
    )
    assert (taught.forecast.tolist(), gone.tolist()) == ([11], [])
    np.testing.assert_allclose(taught.by, taught_by(np.array([0.6]), 0.075))
    taught, gone = compare_with_detections([past], np.array([9, 13]), known, np.zeros((2, 2, 1)), 0.0, 1.0)
    assert (taught.forecast.tolist(), gone.tolist()) == ([10, 11], [12])


@pytest.mark.parametrize(("people", "gain"), [(8, 0.075), (10, 0.075), (12, 0.0625)])
def test_errors_teach_by_the_regions_that_miss_them(people, gain):
    """The gain is 0.075 per second, of more than ten people at a step 0.75 for all together."""
    u = np.resize(U, people)
    past, known = single(away(u))
    taught, lost = compare_with_detections([past], NONE, known, np.zeros((2, 2, 1)), 0.0, 0.7)
    np.testing.assert_allclose(taught.by, taught_by(u, 0.7 * gain))
    np.testing.assert_array_equal(taught.forecast, 10 + np.arange(people))
    np.testing.assert_array_equal(taught.until_s, 7.0)
    assert len(lost) == 0
    np.testing.assert_allclose(taught_by(0.01, 1.0)[0], -(1 + 0.1 / 0.3 + 0.05 / 0.0475**0.5) / 3)


def test_people_count_together_who_share_a_group_and_a_step():
    """15 at step 1 who walk, 12 at step 1 who stand, 11 at step 0 who walk; not who is not detected."""
    group, u = np.repeat([0, 1], [12, 15]), np.resize(U, 27)
    first, known = single(away(u), step=1, group=group)
    person = np.array([*range(11), 60, 61])
    given = {"forecast": 70 + np.arange(13), "until_s": 9.0, "person": person, "group": np.ones(13, int)}
    second = single(away(u[:13]), **given)[0]
    taught, lost = compare_with_detections([first, second], NONE, known, np.zeros((2, 2, 2)), 0.0, 1.0)
    gain = 0.75 / np.repeat([12, 15, 11], [12, 15, 11])
    np.testing.assert_allclose(taught.by, taught_by(np.concatenate([u, u[:11]]), gain))
    np.testing.assert_array_equal(taught.step, [1] * 27 + [0] * 11)
    np.testing.assert_array_equal(taught.group, [*group, *[1] * 11])
    np.testing.assert_array_equal(taught.until_s, [7.0] * 27 + [9.0] * 11)
    np.testing.assert_array_equal(lost, [81, 82])


@pytest.mark.parametrize("share", [0.0, 0.25])
def test_noise_of_detections_is_added_before_the_comparison(share):
    """0.2^2 m^2 of the forecast and ((1 - s)^2 + s^2) 0.3^2 m^2 of a detection between two others."""
    deviation_m = np.sqrt(0.04 + 0.09 * ((1 - share) ** 2 + share**2))
    u = np.array([0.49, 0.51, 0.89, 0.91, 0.945, 0.955])
    past, known = single(deviation_m * away(u), 0.2)
    time_s = np.concatenate([known.time_s - 0.8 * share, known.time_s + 0.8 * (1 - share)])
    order = np.argsort(np.tile(known.person, 2), kind="stable")
    both = Detections(time_s[order], np.tile(known.person, 2)[order], np.tile(known.position, (2, 1))[order])
    taught, _ = compare_with_detections([past], NONE, both, np.zeros((2, 2, 1)), 0.3, 1.0)
    np.testing.assert_allclose(taught.by, taught_by(u, 0.075))


def test_most_of_what_was_learned_since_is_applied_first():
    """Standard deviations of two groups times exp(0.8 (a now - a then)); of one mode b plays no part."""
    now = np.array([[[0.9, 0.5], [0.1, -0.4]], [[0.0, 1.0], [0.0, 0.3]]])
    then = np.array([[0.2, 0.3], [0.4, -0.1]])
    group = np.repeat([0, 1], len(U))
    wider = np.exp(0.8 * np.where(group == 0, 0.5 - 0.2, -0.4 - 0.3))
    past, known = single(wider * away(np.tile(U, 2)), step=1, group=group, learned=then)
    taught, _ = compare_with_detections([past], NONE, known, now, 0.0, 1.0)
    np.testing.assert_allclose(taught.by, taught_by(np.tile(U, 2), 0.075))


def test_modes_are_widened_by_the_probability_before_them():
    """exp(0.8 (a + b (2 t_k - 1))) for changes a and b; then regions of the mixture, with the noise added."""
    rng, rows = np.random.default_rng(3), 300
    path, root = rng.normal(0, 0.8, (rows, 3, 2)), rng.normal(0, 0.5, (rows, 3, 2, 2)) + 0.2 * np.eye(2)
    sigma, weight = root @ np.swapaxes(root, -1, -2), -np.sort(-rng.dirichlet(np.ones(3), rows), axis=1)
    group, truth = rng.integers(0, 2, rows), rng.normal(0, 1.5, (rows, 2))
    now, then = rng.uniform(-0.5, 0.9, (2, 2, 1)), rng.uniform(-0.5, 0.9, (2, 2))
    past = pending(path, sigma, weight, group=group, learned=then)
    known = Detections(np.full(rows, 3.0), np.arange(rows), truth)
    taught, _ = compare_with_detections([past], NONE, known, now, 0.1, 1.0)
    a, b = 0.8 * (now[:, group, 0] - then[:, group])[..., None]
    middle = np.stack([weight[:, 0] / 2, weight[:, 0] + weight[:, 1] / 2, 1 - weight[:, 2] / 2], axis=1)
    wide = np.exp(2 * (a + b * (2 * middle - 1)))[..., None, None] * sigma + 0.01 * np.eye(2)
    forecasts = Predictions(path[:, 0, None], path[:, :, None], weight, 0.4, wide[:, :, None])
    u = share_inside(forecasts, truth[:, None], COARSE)[:, 0]
    assert (np.histogram(u, [0, *REGIONS, 1])[0] > 20).all()
    gain = np.minimum(0.075, 0.75 / np.bincount(group)[group])
    np.testing.assert_allclose(taught.by, taught_by(u, gain))


def test_what_is_taught_is_summed_by_group_and_step():
    one = Adjustment(
        np.array([1.0, 2.0, 3.0]), np.array([0, 1, 1]), np.array([2, 0, 0]), np.array([7, 8, 9]),
        np.array([[0.1, 0.2, 0.4], [-1.0, -2.0, -4.0]]),
    )  # fmt: skip
    other = one.select(np.array([False, True, False]))
    expected = np.zeros((2, 3, 3))
    expected[:, 0, 2], expected[:, 1, 0] = [0.1, -1.0], [0.8, -8.0]
    both = one.concatenated(other)
    np.testing.assert_allclose(both.sums(3), expected)
    np.testing.assert_array_equal(both.forecast, [7, 8, 9, 8])
    np.testing.assert_array_equal(both.until_s, [1.0, 2.0, 3.0, 2.0])
    assert Adjustment.empty().sums(3).tolist() == np.zeros((2, 3, 3)).tolist()


def test_deviations_grow_by_mode_and_step():
    """exp(a + b (2 t_k - 1)) with t = 0.25, 0.65 and 0.9 for weights 0.5, 0.3 and 0.2."""
    sigma = np.random.default_rng(4).uniform(0.5, 1.0, (1, 3, 2))[..., None, None] * np.eye(2)
    given = Predictions(np.zeros((1, 2, 2)), np.zeros((1, 3, 2, 2)), np.array([[0.5, 0.3, 0.2]]), 0.4, sigma)
    after = widen_covariances(given, np.array([[0.4, -0.2]]), np.array([[0.6, -0.1]]), 0.0)
    factor = [[0.4 - 0.3, -0.2 + 0.05], [0.4 + 0.18, -0.2 - 0.03], [0.4 + 0.48, -0.2 - 0.08]]
    np.testing.assert_allclose(after.covariance, np.exp(2 * np.array(factor))[None, ..., None, None] * sigma)


def test_deviations_do_not_shrink_below_a_least_one():
    """Along the short axis: (0.05, 0.03; 0.03, 0.05) has variances 0.08 and 0.02 along its axes, m^2.

    A least of 0.1 m keeps half of 0.02; one that is smaller as it is stays; what grows does.
    """
    sigma = np.array([[[0.05, 0.03], [0.03, 0.05]], [[0.004, 0.0], [0.0, 0.5]], [[0.04, 0.0], [0.0, 0.02]]])
    given = Predictions.single(np.zeros((3, 1, 2)), 0.4, sigma[:, None])
    for factor, expected in ((0.1, [0.5, 1.0, 0.5]), (0.7, [0.7, 1.0, 0.7]), (4.0, [4.0, 4.0, 4.0])):
        a = np.full((3, 1), 0.5 * np.log(factor))
        after = widen_covariances(given, a, np.zeros((3, 1)), 0.1)
        np.testing.assert_allclose(after.covariance[:, 0, 0], np.array(expected)[:, None, None] * sigma)
