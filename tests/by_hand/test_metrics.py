"""Metrics of forecasts: values from their equations, in cases where a wrong equation gives another value."""

import numpy as np
import pytest
from scipy.stats import rice

from pedpred.metrics import METRICS
from pedpred.metrics.calibration import FINE
from pedpred.metrics.paths import too_close
from pedpred.scenes import OccupancyMap, Predictions
from tests.by_hand.modes import PATHS, SEEN, SHARES, SIGMAS, modes_of, scene_of

WEIGHT = np.array([0.4, 0.2, 0.15, 0.1, 0.08, 0.05, 0.02])
TRUTH = np.array([
    [[3.0, -1.0], [3.4, -0.7], [4.1, 0.2]],
    [[-2.0, 5.0], [-2.1, 5.6], [-1.7, 6.5]],
    [[0.5, 0.3], [0.6, 0.2], [0.6, -0.4]],
])  # fmt: skip
MODES_M = np.array([
    [[4, 1, 1], [1, 1, 5.5], [1, 3, 0.5], [0.2, 0.2, 9.2], [0.9, 0.9, 1.2], [3, 3, 0.3], [0, 0, 0]],
    [[2, 2.5, 6], [7, 7, 7], [5, 1, 3], [1, 1, 4], [1, 0.6, 2.9], [8, 8, 8], [0.1, 0.1, 0.1]],
    [[0.3, 0.1, 0.8], [1, 2, 3], [0.3, 0.9, 0.9], [6, 6, 6], [0.2, 0.5, 1.4], [0.3, 0.3, 0.3], [0, 0, 0]],
])  # fmt: skip
"""Distances from the truth, m: [3 windows, 7 modes, 3 steps]."""
POINT_M = np.array([[1, 4, 1.3], [0.5, 0.5, 2], [3, 2, 0.4]])
DISTANCES = {
    "ade_m": [2.1, 1.0, 1.8],
    "fde_m": [1.3, 2.0, 0.4],
    "moving_ade_m": [2.1, np.nan, np.nan],
    "standing_ade_m": [np.nan, 1.0, 1.8],  # the third person walks at exactly the threshold
    "most_likely_ade_m": [2.0, 3.5, 0.4],
    "min_ade_m_k1": [2.0, 3.5, 0.4],
    "min_ade_m_k3": [1.5, 3.0, 0.4],  # the best mode at each step alone would give 0.83, 2, 0.4
    "min_ade_m_k6": [1.0, 1.5, 0.3],  # the seventh mode is the best of all
    "min_fde_m_k1": [1.0, 6.0, 0.8],
    "min_fde_m_k3": [0.5, 3.0, 0.8],
    "min_fde_m_k6": [0.3, 2.9, 0.3],
    "miss_rate_k1": [1, 1, 1],
    "miss_rate_k3": [0, 1, 1],
    "miss_rate_k6": [0, 1, 0],
}


def at_distance(truth, distance_m):
    """Positions so far from the true ones, each in another direction."""
    angle = 2.3 * np.arange(distance_m.size).reshape(distance_m.shape) + 0.4
    return truth + distance_m[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


@pytest.mark.parametrize("key", DISTANCES)
def test_distances_of_three_windows_seven_modes(key):
    """ADE: mean over the steps. FDE: last step. minADE_k: least ADE of whole paths among the first k modes.

    minFDE_k likewise; a miss if it exceeds 0.7 m. Argoverse (Chang et al. 2019, sec. 5).
    """
    given = modes_of(at_distance(TRUTH[:, None], MODES_M), WEIGHT, point=at_distance(TRUTH, POINT_M))
    scene = scene_of(3, speed_mps=np.array([0.9, 0.35, 0.5]))
    np.testing.assert_allclose(METRICS[key].value(given, TRUTH, scene), DISTANCES[key], rtol=1e-12)


def test_who_stops_and_who_starts():
    """Threshold 0.5 m/s; now faster than 1, then at most 0.5, or now at most 0.5, then faster than 1 m/s.

    At the end means the last three intervals of 0.4 s, 1.2 s. Far steps before do not count.
    """
    ends_m = np.array([0.6, 0.61, 0.6, 1.2, 1.21, 1.21])  # 0.5, 0.508, 0.5, 1, 1.008, 1.008 m/s
    now_mps = np.array([1.01, 1.01, 1.0, 0.5, 0.5, 0.51])
    there = np.array([[9.0, 9.0], [0.0, 0.0], [7.0, 7.0], [5.0, 2.0]])  # the last position follows
    truth = np.concatenate([np.tile(there, (6, 1, 1)), ends_m[:, None, None] * [[[0.6, -0.8]]]], axis=1)
    given = Predictions.single(at_distance(truth, np.full((6, 5), 0.7)), 0.4)
    scene = scene_of(6, speed_mps=now_mps)
    for key, chosen in (("stopping_ade_m", 0), ("starting_ade_m", 4)):
        expected = np.where(np.arange(6) == chosen, 0.7, np.nan)
        np.testing.assert_allclose(METRICS[key].value(given, truth, scene), expected, rtol=1e-12)


@pytest.mark.parametrize("key", ["stopping_ade_m", "starting_ade_m"])
def test_nobody_stops_or_starts_within_one_step(key):
    given = Predictions.single(np.zeros((2, 1, 2)), 0.4)
    found = METRICS[key].value(given, np.ones((2, 1, 2)), scene_of(2, speed_mps=np.array([0.1, 3.0])))
    np.testing.assert_array_equal(found, [np.nan, np.nan])


def test_at_the_threshold_is_no_miss():
    given = Predictions.single(np.array([[[9.0, 9.0], [3.0, 4.0]], [[9.0, 9.0], [3.0, 4.001]]]), 0.4)
    found = METRICS["miss_rate_k1"].value(given, np.zeros((2, 2, 2)), scene_of(2, miss_m=5.0))
    np.testing.assert_array_equal(found, [0.0, 1.0])


def test_share_of_the_steps_in_occupied_cells():
    """Cell (1, 2) is [-0.5, 0) x [3, 3.5), cell (4, 0) is [1, 1.5) x [2, 2.5) m; the modes do not count."""
    occupied = np.zeros((5, 4), bool)
    occupied[1, 2] = occupied[4, 0] = True
    walls = OccupancyMap(occupied, np.array([-1.0, 2.0]), 0.5)
    point = np.array([
        [[-0.3, 3.2], [-0.3, 2.9], [1.2, 2.1]],
        [[0.2, 2.7], [9.0, 9.0], [0.1, 3.2]],
        [[0.9, 2.1], [1.4, 2.4], [1.4, 2.6]],
    ])  # fmt: skip
    given = modes_of(np.full((3, 2, 3, 2), [1.1, 2.2]), [0.7, 0.3], point=point)
    found = METRICS["obstacle_share"].value(given, point, scene_of(3, walls))
    np.testing.assert_allclose(found, [2 / 3, 0, 1 / 3])


TIME_S = np.array([1.5, 1.0, 0.2, 1.0, 1.5, 0.2, 1.0 + 9.5e-7, 0.2, 2.0, 2.0 + 1.05e-6])
MET = np.array([
    [[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]],  # in nobody's way at its own instant, 1.5 s
    [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]],  # meets the last but three at the last step: 0.36 m
    [[7.0, 7.0], [7.3, 7.4], [7.0, 9.0]],  # is met at the first step, and at the last one
    [[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]],  # passes (1, 0), where another one is a step later
    [[1.5, 0.0], [9.0, 9.0], [8.0, 8.0]],  # exactly 0.5 m from the first one: no collision
    [[7.2, 7.2], [8.3, 7.4], [8.0, 9.0]],
    [[5.0, 5.0], [5.0, 5.0], [2.3, 0.2]],
    [[6.0, 6.0], [6.0, 6.4], [7.4, 9.2]],
    [[3.0, 3.0], [3.0, 3.0], [3.0, 3.0]],
    [[3.0, 3.0], [3.0, 3.0], [3.0, 3.0]],  # a microsecond is one instant, more is another
])  # fmt: skip
MEETS = np.array([0, 1, 1, 0, 0, 1, 1, 1, 0, 0])


def test_who_is_near_at_the_same_step_of_an_instant_collides():
    found = too_close(MET, TIME_S, 0.5)
    np.testing.assert_array_equal(found, MEETS == 1)
    assert too_close(MET[:0], TIME_S[:0], 0.5).shape == (0,)
    assert not too_close(MET[:1], TIME_S[:1], 0.5).any()


@pytest.mark.parametrize(("key", "met"), [("collision_share", 0), ("mode_collision_share", 1)])
def test_collisions_of_the_point_and_of_the_likeliest_mode(key, met):
    """Only the most likely modes meet; the others and the point forecasts are far apart."""
    apart = MET + 50.0 * np.arange(10)[:, None, None]
    given = modes_of(np.stack([MET, apart, apart], axis=1), SHARES, point=apart)
    swapped = modes_of(np.stack([apart, MET, apart], axis=1), SHARES, point=MET)
    scene = scene_of(10, time_s=TIME_S, collision_m=0.5)
    np.testing.assert_array_equal(METRICS[key].value(given, MET, scene), met * MEETS)
    np.testing.assert_array_equal(METRICS[key].value(swapped, MET, scene), (1 - met) * MEETS)


def test_one_mode_has_no_collisions_of_modes():
    given = Predictions.single(MET, 0.4)
    found = METRICS["mode_collision_share"].value(given, MET, scene_of(10, time_s=TIME_S, collision_m=0.5))
    np.testing.assert_array_equal(found, np.full(10, np.nan))


def test_energy_score_of_paths_is_the_mean_over_the_steps():
    """ES = sum_i w_i |x_i - y| - sum_ij w_i w_j |x_i - x_j| / 2, weights 0.5, 0.3, 0.2.

    Modes on a line through the truth, at 1, -2, 4 | 0, 5, -1 | 2, 2, 10 m:
    1.9 - (0.15 * 3 + 0.1 * 3 + 0.06 * 6) = 0.79, 1.7 - 1.21 = 0.49, 3.6 - 1.28 = 2.32. Their mean is 1.2.
    """
    along_m = np.array([[1.0, 0.0, 2.0], [-2.0, 5.0, 2.0], [4.0, -1.0, 10.0]])
    path = TRUTH[:1, None] + along_m[..., None] * [0.6, -0.8]
    given = modes_of(path, [0.5, 0.3, 0.2])
    np.testing.assert_allclose(METRICS["energy_score_m"].value(given, TRUTH[:1], scene_of(1)), [1.2])


def test_energy_score_of_gaussian_modes():
    """E|X - y| - E|X - X'| / 2 with X - X' of modes i, j: mean mu_i - mu_j, covariance Sigma_i + Sigma_j.

    |X - X'| of (i, j) is that of (j, i): half of the double sum is each pair once, and half of i = j.
    """

    def length(mean, sigma):
        return np.linalg.norm(mean + FINE.offset @ np.linalg.cholesky(sigma).T, axis=1).mean()

    expected = np.zeros(2)
    for w, i, p in np.ndindex(2, 3, 3):
        expected[w] += SHARES[i] * length(PATHS[w, i, p] - SEEN[w, p], SIGMAS[w, i, p]) / 3
        for j in range(i + 1):
            apart = length(PATHS[w, i, p] - PATHS[w, j, p], SIGMAS[w, i, p] + SIGMAS[w, j, p])
            expected[w] -= (1.0 if j < i else 0.5) * SHARES[i] * SHARES[j] * apart / 3
    found = METRICS["energy_score_m"].value(modes_of(PATHS, SHARES, SIGMAS), SEEN, scene_of(2))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_energy_score_of_round_gaussians_is_that_of_rice():
    """|Z| of a round Gaussian with mean m and deviation s follows Rice's distribution (Rice 1945)."""
    centre_m, deviation_m, weight = np.array([1.0, -0.5, 4.0]), np.array([0.5, 1.5, 0.8]), SHARES
    path = np.stack([0.6 * centre_m, 0.8 * centre_m], axis=-1)[None, :, None]
    sigma = (deviation_m**2)[None, :, None, None, None] * np.eye(2)
    expected = sum(w * rice.mean(abs(m) / s, scale=s)
                   for w, m, s in zip(weight, centre_m, deviation_m, strict=True))  # fmt: skip
    for i, j in np.ndindex(3, 3):
        s = np.hypot(deviation_m[i], deviation_m[j])
        expected -= weight[i] * weight[j] * rice.mean(abs(centre_m[i] - centre_m[j]) / s, scale=s) / 2
    found = METRICS["energy_score_m"].value(modes_of(path, weight, sigma), np.zeros((1, 1, 2)), scene_of(1))
    np.testing.assert_allclose(found, expected, rtol=0.01)


@pytest.mark.parametrize("key", METRICS)
def test_the_perfect_forecast_is_better(key):
    """Beside one that leads everybody into the same occupied cell; by the direction in the table."""
    truth = np.concatenate([TRUTH, TRUTH + np.array([4.0, 1.0])])
    truth[0] = truth[0, 0]  # stops
    wall = OccupancyMap(np.ones((2, 2), bool), np.array([30.0, 40.0]), 1.0)
    scene = scene_of(6, wall, speed_mps=np.array([1.2, 0.1] * 3), time_s=np.full(6, 3.0))
    sigma = np.tile(0.04 * np.eye(2), (6, 2, 3, 1, 1))
    values = [
        np.nanmean(METRICS[key].value(modes_of(np.stack([at, at], 1), [0.7, 0.3], sigma, at), truth, scene))
        for at in (truth, np.full((6, 3, 2), [30.7, 41.2]))
    ]
    assert (values[0] < values[1]) == (METRICS[key].better == "lower")
    assert values[0] != values[1]
