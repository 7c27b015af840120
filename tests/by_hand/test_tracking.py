"""The tracker beside numbers by hand: filter, lives, heading, spacing, resampling and likelihood."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.scenes import Scene, Trajectories
from pedpred.tracking import (
    Belief,
    KalmanSettings,
    correct,
    follow,
    initial_belief,
    log_likelihood,
    predict,
    resampled,
    steady_state,
    tune_kalman,
)
from pedpred.tracking import tracks as lives
from pedpred.tracking.matching import cheapest_pairs, distances_m
from pedpred.tracking.spacing import references, spaced
from pedpred.tracking.steps import are_too_long, catch_up
from pedpred.tracking.tracks import births, jumped, last_rows
from tests.by_hand.walks import (
    SHORT,
    SHORT_S,
    TIME_S,
    WAY,
    extrapolated,
    lagrange,
    settled,
    textbook,
    two_walks,
)
from tests.worlds import empty_map

COVARIANCE = np.array([[0.5, 0.2, 0.9], [0.04, -0.03, 0.7], [1.2, 0.6, 2.0]])
PLACE = np.array([[1.0, -2.0], [4.0, 0.5], [-3.0, 7.0]])
PACE = np.array([[0.6, 1.1], [-0.4, 0.2], [1.5, -0.9]])


# The filter


@pytest.mark.parametrize("q", [0.3, np.array([0.3, 0.8, 0.05])])
def test_a_prediction_adds_the_white_noise_of_its_time(q):
    """P_pp + 2 dt P_pv + dt^2 P_vv + q dt^3/3, P_pv + dt P_vv + q dt^2/2, P_vv + q dt; x + dt v."""
    dt_s = np.array([0.3, 0.4, 1.3])
    after = predict(Belief(PLACE, PACE, COVARIANCE), dt_s, q)
    first = [0.5 + 0.12 + 0.081 + 0.0027, 0.2 + 0.27 + 0.0135, 0.9 + 0.09]
    np.testing.assert_allclose(after.covariance[0], first)
    for n, density in enumerate(np.broadcast_to(q, 3)):
        cov = COVARIANCE[n, [0, 1, 1, 2]].reshape(2, 2)
        mean, cov = extrapolated(np.array([PLACE[n], PACE[n]]), cov, dt_s[n], density)
        np.testing.assert_allclose(after.covariance[n], cov.ravel()[[0, 1, 3]])
        np.testing.assert_allclose([after.position[n], after.velocity[n]], mean)
    np.testing.assert_allclose(after.position[1], [4.0 - 0.16, 0.5 + 0.08])


@pytest.mark.parametrize("r", [0.2, np.array([0.2, 0.1, 0.4])])
def test_a_correction_weighs_detections_by_their_variance(r):
    """Gains P_pp / S and P_pv / S with S = P_pp + r^2 max(1, 0.05 s / dt): here r^2, 2.5 r^2 and r^2."""
    dt_s, seen = np.array([0.4, 0.02, 0.05]), np.add(PLACE, [[0.3, -0.1], [0.2, 0.5], [-0.6, 0.4]])
    after = correct(Belief(PLACE, PACE, COVARIANCE), dt_s, seen, r)
    np.testing.assert_allclose(after.position[0], [1.0 + 0.3 * 0.5 / 0.54, -2.0 - 0.1 * 0.5 / 0.54])
    for n, variance in enumerate(np.broadcast_to(r, 3) ** 2 * [1.0, 2.5, 1.0]):
        p, pv, v = COVARIANCE[n]
        gain_p, gain_v = p / (p + variance), pv / (p + variance)
        np.testing.assert_allclose(after.position[n], PLACE[n] + gain_p * (seen - PLACE)[n])
        np.testing.assert_allclose(after.velocity[n], PACE[n] + gain_v * (seen - PLACE)[n])
        expected = [p - gain_p * p, pv - gain_p * pv, v - gain_v * pv]
        np.testing.assert_allclose(after.covariance[n], expected)


def test_a_first_detection_has_its_own_variance_and_no_velocity():
    belief = initial_belief(PLACE, 0.2, 1.5)
    np.testing.assert_allclose(belief.covariance, [[0.04, 0.0, 2.25]] * 3)
    np.testing.assert_array_equal([belief.position, belief.velocity], [PLACE, np.zeros((3, 2))])
    assert KalmanSettings(0.3, 0.1).initial_speed_mps == 1.0


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_a_settled_belief_solves_the_riccati_equation(dt_s):
    belief = steady_state(dt_s, KalmanSettings(0.3, 0.2, 3.0))
    np.testing.assert_allclose(belief.covariance, [settled(dt_s, 0.3, 0.2).ravel()[[0, 1, 3]]])
    np.testing.assert_array_equal([belief.position, belief.velocity], np.zeros((2, 1, 2)))


# Lives


def test_walks_are_filtered_detection_by_detection():
    tracks = follow(two_walks(), "kalman", KalmanSettings(0.4, 0.15, 1.7), 0.2)
    expected = textbook(SHORT_S, SHORT, 0.4, 0.15, 1.7) + textbook(TIME_S, WAY, 0.4, 0.15, 1.7)
    assert tracks.track_id.tolist() == tracks.person_id.tolist() == [5] * 3 + [8] * 5
    assert (tracks.age.tolist(), tracks.life.tolist()) == ([0, 1, 2, 0, 1, 2, 3, 4], [0] * 3 + [1] * 5)
    np.testing.assert_array_equal(tracks.detection, np.concatenate([SHORT, WAY]))
    np.testing.assert_array_equal(tracks.time_s, np.append(SHORT_S, TIME_S))
    for row, (mean, cov) in enumerate(expected):
        np.testing.assert_allclose([tracks.position[row], tracks.velocity[row]], mean, atol=1e-12)
        np.testing.assert_allclose(tracks.covariance[row], cov.ravel()[[0, 1, 3]])
    row, later_s = np.array([6, 1]), np.array([3.0, 3.3])
    ahead = tracks.belief_at(row, later_s, 0.4)
    for n, (k, dt) in enumerate(zip(row, later_s - [2.72, 2.5], strict=True)):
        mean, cov = extrapolated(*expected[k], dt, 0.4)
        np.testing.assert_allclose([ahead.position[n], ahead.velocity[n]], mean)
        np.testing.assert_allclose(ahead.covariance[n], cov.ravel()[[0, 1, 3]])
        np.testing.assert_allclose(tracks.position_at(row, later_s)[n], mean[0])


def test_a_life_ends_with_a_long_gap_or_a_jump():
    """2 s and a microsecond are no gap, 1 m + 10 m/s dt is no jump: at most 5 m in 0.4 s."""
    track = np.array([3, 3, 3, 3, 3, 3, 4])
    time_s = np.array([1.0, 3.0, 5.0000005, 7.0000025, 7.4000025, 7.8000025, 7.9])
    place = np.array([[0, 0], [0, 0], [0, 0], [1, 1], [4, 5], [7.1, 9.0], [7.1, 9.0]])
    assert births(track, time_s, place, 2.0).tolist() == [True, False, False, True, False, True, True]
    assert births(track, time_s, place, lives.LOST_AFTER_S).sum() == 4
    assert births(track, time_s, place, 1.9).tolist() == [True, True, True, True, False, True, True]
    before, after = np.array([[1.0, 2.0]] * 3), np.array([[4.0, 6.0], [-1.5, -1.5], [1.0, 6.2]])
    away = jumped(before, after, np.array([0.4, 0.3, 0.3]))
    assert away.tolist() == [False, True, True]
    walk = Trajectories(time_s, track, place)
    for life, most_s in (([0, 0, 0, 1, 1, 2, 3], 2.0), ([0, 0, 0, 0, 0, 1, 2], 2.5)):
        assert follow(walk, "kalman", KalmanSettings(0.3, 0.1), 0.2, most_s).life.tolist() == life
    assert follow(walk, "kalman", KalmanSettings(0.3, 0.1), 0.2).life.tolist() == [0, 0, 0, 1, 1, 2, 3]


def test_the_last_row_is_found_within_a_microsecond():
    track, time_s = np.array([1, 2, 2, 2, 7, 7]), np.array([1.1, 1.0, 1.4, 2.0, -3.0, 1.4])
    asked_id = [2, 2, 2, 2, 2, 2, 7, 7, 7, 7, 5, 1, 9, 9, 0]
    asked_s = [1.4, 1.4 - 5e-7, 1.4 - 3e-6, 0.9, -99.0, 99.0, -3.0, -3.1, 1.3, 50.0, 1.4, 5.0, 1.0, 99.0, 3.0]
    found = last_rows(track, time_s, np.array(asked_id), np.array(asked_s))
    assert found.tolist() == [2, 2, 1, -1, -1, 3, 4, -1, 4, 5, -1, 0, -1, -1, -1]
    none = np.zeros(0)
    assert last_rows(none.astype(int), none, none.astype(int), none).tolist() == []
    assert last_rows(none.astype(int), none, np.array([3, 4]), np.array([0.0, 1.0])).tolist() == [-1, -1]


def test_the_heading_holds_below_the_speed_of_standstill():
    """At least 0.5 m/s is a motion; before the first one, the latest velocity that is not 0; else world x."""
    stands = [(0, 0), (0, 0.1), (0, 0), (-0.2, 0)]
    walks = [(0.3, 0.4), (0.1, -0.4), (0, -0.6), (0, 0), (0.4, 0.2), (-0.3, -0.4)]
    lives = [[(-2.0, 0.0), (0.2, 0.0)], stands + walks, [(0, 0), (0.1, 0.1), (0, 0)]]
    angle, up, down, back = np.arctan2(0.4, 0.3), np.pi / 2, -np.pi / 2, np.pi
    expected = [back, back, 0, up, up, back, angle, angle, down, down, down, angle - np.pi]
    expected += [0.0, np.pi / 4, np.pi / 4]
    counts = [len(life) for life in lives]
    time_s = np.concatenate([0.4 * np.arange(count) for count in counts])
    truth = np.concatenate(lives)
    people = Trajectories(time_s, np.repeat([4, 6, 9], counts), np.zeros_like(truth), truth)
    tracks = follow(people, "truth", None, 0.5)
    np.testing.assert_allclose(tracks.heading_rad, expected)
    np.testing.assert_array_equal(tracks.velocity, truth)
    assert not tracks.covariance.any()
    assert tracks.covariance.shape == (15, 3)


def test_true_states_are_taken_only_where_they_are_asked_for():
    """Not without velocities, not by another name, and also where there are filters."""
    filters, velocity = KalmanSettings(0.3, 0.1), np.array([[0.6, -0.8], [0.1, 0.9]])
    known = Trajectories([0.0, 0.4], [3, 3], np.zeros((2, 2)), velocity)
    np.testing.assert_array_equal(follow(known, "truth", filters, 0.2).velocity, velocity)
    for walks, kind, kalman in (
        (known, "kalman", None),
        (known, "other", filters),
        (replace(known, velocity=None), "truth", filters),
    ):
        with pytest.raises(ValueRuleError):
            follow(walks, kind, kalman, 0.2)


def test_the_person_behind_an_id_is_kept():
    walks = Trajectories([0.0, 0.4, 0.0, 0.4], [3, 3, 1, 1], np.zeros((4, 2)), person_id=[7, 8, 8, 7])
    assert follow(walks, "kalman", KalmanSettings(0.3, 0.1), 0.2).person_id.tolist() == [8, 7, 7, 8]


# Spacing, steps and pairs


BURST_S = [1.0, 1.02, 1.049, 1.05, 1.09, 1.2, 1.2499995, 1.29, 0.4, 0.41, 0.5, 0.6]
BURST_S = np.array([*BURST_S, 0.2, 0.3, 0.43, 0.43 + 0.04999895])
BURST_AGE = np.array([*range(8), *range(4), *range(4)])


def test_detections_are_kept_every_twentieth_of_a_second():
    """1.0, 1.05, 1.2 and 1.25 s less half a microsecond; 0.4, 0.5, 0.6; 0.2, 0.3, 0.43, not 1.05 us less."""
    kept = [True, False, False, True, False, True, True, False]
    kept += [True, False, True, True, True, True, True, False]
    assert spaced(BURST_S, BURST_AGE).tolist() == kept
    walk = Trajectories(BURST_S, np.repeat([1, 2, 3], [8, 4, 4]), np.zeros((16, 2)))
    tracks = follow(walk, "kalman", KalmanSettings(0.3, 0.1), 0.2)
    assert tracks.kept().tolist() == kept
    assert tracks.kept_before(np.arange(16)).tolist() == [0, 1, 1, 1, 2, 2, 3, 4, 0, 1, 1, 2, 0, 1, 2, 3]


def test_velocities_are_measured_over_a_twentieth_of_a_second():
    """From the latest kept detection that is 0.05 s older; from a life's first one if it is younger."""
    assert references(BURST_S, BURST_AGE).tolist() == [0, 0, 0, 0, 0, 3, 5, 5, 8, 8, 8, 10, 12, 12, 13, 13]


def test_a_step_too_long_is_above_half_a_metre_and_4_mps():
    """1.7 m in 0.3 s and 2.1 m in 0.4 s are the limits."""
    way_m, gap_s = np.array([1.69, 1.71, 2.09, 2.11]), np.array([0.3, 0.3, 0.4, 0.4])
    assert are_too_long(way_m, gap_s).tolist() == [False, True, False, True]


def test_who_catches_up_stood_and_steps_far_and_fast():
    """Farther than 0.1 m and faster than 6 m/s: 1.8 m in 0.3 s, 2.4 m in 0.4 s, 0.1 m in 0.01 s."""
    way_m, gap_s = np.array([1.79, 1.81, 2.39, 2.41, 0.09, 0.11]), np.array([0.3, 0.3, 0.4, 0.4, 0.01, 0.01])
    assert catch_up(np.ones(6, bool), way_m, gap_s).tolist() == [False, True] * 3
    assert not catch_up(np.zeros(6, bool), way_m, gap_s).any()


def test_pairs_have_the_least_sum_and_not_the_least_cost():
    """2 + 3 < 1 + 7 < 1 + 9: the cheapest pair, the first two, is left out; the third row has no partner."""
    costs = np.array([[1.0, 2.0], [3.0, 9.0], [8.0, 7.0]])
    for given, pairs in ((costs, [[0, 1], [1, 0]]), (costs.T, [[0, 1], [1, 0]])):
        assert np.array(cheapest_pairs(given)).tolist() == pairs
    far = distances_m(np.array([[1.0, 2.0], [0.0, 0.0]]), np.array([[4.0, 6.0], [1.0, 2.0], [-5.0, 12.0]]))
    np.testing.assert_allclose(far, [[5.0, 0.0, np.sqrt(136.0)], [np.sqrt(52.0), np.sqrt(5.0), 13.0]])


@pytest.mark.parametrize(
    ("costs", "column"),
    [
        ("11 26 4 17 21 25 | 15 11 9 12 14 21 | 26 2 28 15 10 20 | 17 7 9 21 17 16", [2, 3, 4, 1]),
        ("18 21 28 19 11 2 | 16 6 17 0 25 28 | 4 24 12 1 27 28 | 1 17 24 23 12 25 | 24 3 0 3 10 3", None),
        ("16 21 17 22 5 23 | 15 22 15 9 2 15 | 29 1 17 13 0 16 | 23 22 29 15 17 28 | 9 23 5 10 20 17", None),
    ],
)
def test_no_other_pairs_have_a_smaller_sum(costs, column):
    """Of all ways to give each row a column of its own; the first is 4 + 12 + 10 + 7."""
    costs = np.array([row.split() for row in costs.split("|")], float)
    rows = np.arange(len(costs))
    every = [list(one) for one in permutations(range(6), len(costs))]
    best = min(every, key=lambda one: costs[rows, one].sum())
    assert column in (None, best)
    for given, taken in ((costs, (rows, best)), (costs.T, (np.sort(best), np.argsort(best)))):
        np.testing.assert_array_equal(cheapest_pairs(given), taken)


def test_of_equal_sums_a_row_takes_a_column_that_is_free():
    """The first row has column 0; the second one may push it away, or take column 2 at the same cost."""
    for costs in ([[1, 1, 3], [1, 3, 1]], [[0, 0, 1], [0, 2, 0]], [[2, 2, 2], [0, 1, 0]]):
        assert np.array(cheapest_pairs(np.array(costs, float))).tolist() == [[0, 1], [0, 2]]


# Resampling and likelihood


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_resampled_walks_are_cubic_with_central_differences(dt_s):
    """v(t_k) = (a / b (p(k+1) - p(k)) + b / a (p(k) - p(k-1))) / (a + b) with steps a before and b after."""
    time_s, place = TIME_S[[0, 1, 2, 4]], WAY[[0, 1, 2, 4]]
    one = Trajectories(np.append(time_s, 0.5), [6] * 4 + [2], np.append(place, [[0.0, 0.0]], axis=0))
    scene = resampled(Scene("walk", one, empty_map(), 0.4), dt_s)
    steps = int(1.6 / dt_s + 1e-9) + 1
    h, pace = np.diff(time_s), [(place[1] - place[0]) / 0.3]
    for k in (1, 2):
        a, b = h[k - 1], h[k]
        ahead, behind = place[k + 1] - place[k], place[k] - place[k - 1]
        pace.append((a / b * ahead + b / a * behind) / (a + b))
    pace = np.array([*pace, (place[3] - place[2]) / 0.9])
    now_s = 2.0 + dt_s * np.arange(steps)
    found = scene.trajectories
    assert (scene.detection_dt_s, found.track_id.tolist()) == (dt_s, [6] * steps)
    np.testing.assert_allclose(found.time_s, now_s)
    np.testing.assert_allclose(found.position, lagrange(time_s, place, now_s), atol=1e-12)
    np.testing.assert_allclose(found.velocity, lagrange(time_s, pace, now_s), atol=1e-12)


def test_resampling_does_not_cross_gaps_and_needs_two_instants():
    """2 s are no gap, and 1.2 s less half a microsecond are four steps of 0.3 s; 0.35 s one; 0.2 s none."""
    time_s = [0.0, 2.0, 4.1, 5.2999995, 9.0, 9.35, 12.0, 12.2]
    walk = Trajectories(time_s, [3] * 8, np.column_stack([np.arange(8.0), np.zeros(8)]))
    found = resampled(Scene("walk", walk, empty_map(), 0.4), 0.3).trajectories
    np.testing.assert_allclose(found.time_s, [*(0.3 * np.arange(7)), *(4.1 + 0.3 * np.arange(5)), 9.0, 9.3])
    np.testing.assert_allclose(found.velocity[:, 0], [0.5] * 7 + [1 / 1.2] * 5 + [1 / 0.35] * 2, rtol=1e-6)
    patient = resampled(Scene("walk", walk, empty_map(), 0.4), 0.3, 2.2).trajectories
    assert (patient.time_s < 5.4).sum() == 18
    nobody = Trajectories(np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    assert len(resampled(Scene("none", nobody, empty_map(), 0.4), 0.3).trajectories) == 0


@pytest.mark.parametrize("ahead", [1, 2, 3])
def test_likelihood_is_the_mean_log_density_of_detections(ahead):
    """log p = -log(2 pi S) - |n|^2 / (2 S) of each detection up to three ahead, within a life."""
    q, r, v0 = 0.4, 0.15, 1.7
    logs = []
    for time_s, places in ((SHORT_S, SHORT), (TIME_S, WAY)):
        past = textbook(time_s, places, q, r, v0)
        for k, distance in np.ndindex(len(time_s), ahead):
            later = k + distance + 1
            if later < len(time_s):
                mean, cov = extrapolated(*past[k], time_s[later] - time_s[k], q)
                s = cov[0, 0] + r**2
                logs.append(-np.log(2 * np.pi * s) - ((places[later] - mean[0]) ** 2).sum() / (2 * s))
    found = log_likelihood(two_walks(), KalmanSettings(q, r, v0), ahead)
    assert found == pytest.approx(np.mean(logs))
    assert len(logs) == {1: 6, 2: 10, 3: 12}[ahead]


def test_likelihood_counts_twelve_distances_at_most():
    """Of 25 detections ahead every second or third."""
    q, r, v0 = 0.4, 0.15, 1.7
    time_s, places = 0.4 * np.arange(26), np.cumsum(np.random.default_rng(0).normal(0, 0.4, (26, 2)), axis=0)
    past, logs = textbook(time_s, places, q, r, v0), []
    for distance in (1, 3, 5, 8, 10, 12, 14, 16, 18, 21, 23, 25):
        for k in range(26 - distance):
            mean, cov = extrapolated(*past[k], 0.4 * distance, q)
            s = cov[0, 0] + r**2
            miss = places[k + distance] - mean[0]
            logs.append(-np.log(2 * np.pi * s) - (miss**2).sum() / (2 * s))
    walk = Trajectories(time_s, [1] * 26, places)
    assert log_likelihood(walk, KalmanSettings(q, r, v0), 25) == pytest.approx(np.mean(logs))


def test_fitted_noise_is_no_less_than_a_ten_thousandth():
    """Exact detections of a straight walk fit the least noise best."""
    straight = Trajectories(TIME_S, [1] * 5, np.outer(TIME_S, [0.6, -0.8]))
    assert tune_kalman(straight, 1).position_noise_m == 1e-4
