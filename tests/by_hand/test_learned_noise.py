"""Weights of the tracker's filters beside numbers by hand."""

import numpy as np

from pedpred.tracking import Belief, KalmanBank, KalmanSettings, correct, follow, predict
from pedpred.tracking.noise import evidence, weighted
from tests.by_hand.walks import SHORT, SHORT_S, TIME_S, WAY, extrapolated, textbook, two_walks

PLACE = np.array([[1.0, -2.0], [4.0, 0.5], [-3.0, 7.0]])
FILTERS = KalmanSettings(0.2, 0.1, 1.2), KalmanSettings(0.05, 0.3, 0.8), KalmanSettings(0.9, 0.012, 2.0)
BANK = KalmanBank(FILTERS)


def test_the_filters_beside_a_models_own_one():
    """q, r, and the shortest interval 0.1^4 q / r^2 at which a filter lags 0.1 s; the first has no limit."""
    bank = KalmanBank.around(KalmanSettings(0.7, 0.4, 1.3))
    np.testing.assert_allclose(bank.acceleration_noise, [0.7, 0.03, 0.0152, 0.05, 0.1])
    np.testing.assert_allclose(bank.position_noise_m, [0.4, 0.1, 0.0335, 0.02, 0.006])
    np.testing.assert_allclose(bank.shortest_s, [0.0, 3e-4, 1.52e-6 / 0.0335**2, 0.0125, 1e-5 / 3.6e-5])
    assert {one.initial_speed_mps for one in bank.filters} == {1.3}
    np.testing.assert_array_equal(bank.initial_weights(2), [[0.0, -2.0, -2.0, -2.0, -2.0]] * 2)
    assert KalmanBank.around(KalmanSettings(0.7, 0.4), False).filters == (KalmanSettings(0.7, 0.4),)
    first = BANK.initial_beliefs(PLACE[:2])
    np.testing.assert_array_equal(first.position, PLACE[[0, 0, 0, 1, 1, 1]])
    variances = [[0.01, 0.0, 1.44], [0.09, 0.0, 0.64], [0.000144, 0.0, 4.0]]
    np.testing.assert_allclose(first.covariance, variances * 2)
    assert not first.velocity.any()
    one = KalmanBank(BANK.filters[1:2]).initial_beliefs(PLACE)
    np.testing.assert_array_equal(one.position, PLACE)
    np.testing.assert_allclose(one.covariance, variances[1:2] * 3)


def test_evidence_is_the_log_density_of_a_detection():
    """-log(2 pi S) - min(n^2 / S, 16) / 2, S = P_pp + r^2; times dt / 0.05 s below that interval.

    Who is slower than 0.5 m/s by the first filter teaches nothing. The third filter wants 0.625 s; sooner,
    it has the density of the first one less the counted share. The innovations of the third person are far.
    """
    p = np.array([0.03, 0.05, 0.001, 0.2, 0.06, 0.07, 0.01, 0.3, 0.02, 0.04, 0.02, 0.01, 0.2, 0.1, 0.3])
    p = p.reshape(5, 3)
    off = np.array([[0.1, -0.2], [0.3, 0.1], [1.0, 2.0], [0.2, 0.0], [0.05, -0.02]])
    pace = np.array([[0.3, 0.4], [-0.9, 0.1], [0.0, 2.0], [0.3, 0.39], [0.6, 0.0]])
    dt_s, place = np.array([0.7, 0.4, 0.3, 0.4, 0.02]), np.zeros((5, 3, 2))
    velocity = np.concatenate([pace[:, None], np.full((5, 1, 2), 3.0), np.zeros((5, 1, 2))], axis=1)
    place[:, 1] = 0.01
    covariance = np.stack([p, p + 9.0, p + 8.0], axis=-1)
    ahead = Belief(place.reshape(-1, 2), velocity.reshape(-1, 2), covariance.reshape(-1, 3))
    np.testing.assert_allclose(BANK.shortest_s, [0.0, 1e-4 * 0.05 / 0.09, 0.625])
    found = evidence(BANK, ahead, dt_s, off, 0.5)
    variance = p + BANK.position_noise_m**2
    miss2 = np.stack([(off**2).sum(1), ((off - 0.01) ** 2).sum(1), (off**2).sum(1)], axis=1) / variance
    assert np.argwhere(miss2 > 16).tolist() == [[0, 2], [2, 0], [2, 2]]
    expected = (-np.log(2 * np.pi * variance) - np.minimum(miss2, 16.0) / 2) * [[1], [1], [1], [0], [0.4]]
    expected[:, 2] = [expected[0, 2], expected[1, 0] - 1, expected[2, 0] - 1, 0.0, expected[4, 0] - 0.4]
    np.testing.assert_allclose(found, expected)


def test_very_hasty_filters_are_judged_by_the_spacing():
    """It wants 0.04 s, and 0.01 s count as the 0.05 s that detections are apart: it is used."""
    bank = KalmanBank((KalmanSettings(0.2, 0.1), KalmanSettings(0.4, 0.0316228)))
    np.testing.assert_allclose(bank.shortest_s[1], 0.04, rtol=1e-5)
    ahead = Belief(np.zeros((2, 2)), np.ones((2, 2)), np.full((2, 3), 0.01))
    found = evidence(bank, ahead, np.array([0.01]), np.zeros((1, 2)), 0.2)
    np.testing.assert_allclose(found[0], -0.2 * np.log(2 * np.pi * np.array([0.02, 0.011])), rtol=1e-5)


def test_log_weights_add_up_and_end_10_below_the_largest():
    """People at 1 m/s: evidence added to the weights, less its maximum, at least -10."""
    before = BANK.initial_beliefs(PLACE)
    before = Belief(before.position, np.full((9, 2), 1.0), before.covariance)
    weights = np.array([[0.0, -2.0, -3.0], [-1.0, 0.0, -9.9], [-4.0, -9.0, 0.0]])
    dt_s = np.array([0.7, 0.4, 0.8])
    seen = PLACE + dt_s[:, None] + [[0.1, 0.2], [1.7, -0.9], [0.02, 0.01]]
    after, found = BANK.follow(before, weights, dt_s, seen, 0.2)
    q, r = np.array([0.2, 0.05, 0.9]), np.array([0.1, 0.3, 0.012])
    p = r**2 + dt_s[:, None] ** 2 * np.array([1.44, 0.64, 4.0]) + q * dt_s[:, None] ** 3 / 3
    off2 = ((seen - PLACE - dt_s[:, None]) ** 2).sum(axis=1)
    s = p + r**2
    density = -np.log(2 * np.pi * s) - np.minimum(off2[:, None] / s, 16.0) / 2
    density[1, 2] = density[1, 0] - 1.0
    expected = weights + density
    expected = np.maximum(expected - expected.max(axis=1)[:, None], -10.0)
    np.testing.assert_allclose(found, expected)
    assert (expected == -10.0).sum() == 1
    ahead = predict(before, np.repeat(dt_s, 3), np.tile(q, 3))
    by_one = correct(ahead, np.repeat(dt_s, 3), np.repeat(seen, 3, axis=0), np.tile(r, 3))
    np.testing.assert_allclose(after.position, by_one.position)
    np.testing.assert_allclose(after.covariance, by_one.covariance)


def test_beliefs_are_averaged_by_their_weights():
    """Log weights 0, log 3 and log 4 are the shares 1/8, 3/8 and 1/2."""
    values = np.array([[1.0, 2.0, 4.0], [8.0, -1.0, 0.5]])
    beliefs = Belief(*(np.outer(values.ravel(), np.arange(1.0, width + 1)) for width in (2, 2, 3)))
    found = weighted(beliefs, np.log([[1.0, 3.0, 4.0], [0.9, 0.3, 1.8]]))
    mean = [1 / 8 + 6 / 8 + 2, 0.3 * 8 - 0.1 + 0.6 * 0.5]
    np.testing.assert_allclose(found.position, np.outer(mean, [1, 2]))
    np.testing.assert_allclose(found.covariance, np.outer(mean, [1, 2, 3]))


def test_a_recording_is_tracked_by_the_weighted_mean_of_filters():
    """Two filters of two people, detection by detection; both are seen to move from the second one on."""
    bank = KalmanBank((KalmanSettings(0.4, 0.15, 1.7), KalmanSettings(0.1, 0.05, 0.9)))
    tracks = follow(two_walks(), "kalman", bank, 0.1)
    for first, time_s, places in ((0, SHORT_S, SHORT), (3, TIME_S, WAY)):
        own, other = (textbook(time_s, places, *noise) for noise in ((0.4, 0.15, 1.7), (0.1, 0.05, 0.9)))
        weight = np.array([0.0, -2.0])
        for k, dt in enumerate(np.append(0.0, np.diff(time_s))):
            if k:
                for n, (past, q, r) in enumerate(((own[k - 1], 0.4, 0.15), (other[k - 1], 0.1, 0.05))):
                    mean, cov = extrapolated(*past, dt, q)
                    s = cov[0, 0] + r**2
                    moves = np.hypot(*own[k - 1][0][1]) >= 0.1
                    miss2 = min(((places[k] - mean[0]) ** 2).sum() / s, 16.0)
                    weight[n] += min(1.0, dt / 0.05) * moves * (-np.log(2 * np.pi * s) - miss2 / 2)
                weight = np.maximum(weight - weight.max(), -10.0)
            share = np.exp(weight) / np.exp(weight).sum()
            mean, cov = (share[0] * a + share[1] * b for a, b in zip(own[k], other[k], strict=True))
            row = first + k
            np.testing.assert_allclose([tracks.position[row], tracks.velocity[row]], mean, atol=1e-9)
            np.testing.assert_allclose(tracks.covariance[row], cov.ravel()[[0, 1, 3]], atol=1e-9)
