"""Trust in a network beside straight lines: what is compared and when, and what follows, by hand."""

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.forecasting.detections import Detections
from pedpred.forecasting.trust import Sums, Trust, best_weights
from pedpred.scenes import Predictions
from tests.learners import at_instant, place_of

STEPS, DT_S = 4, 0.4
AHEAD_S = DT_S * np.arange(1, STEPS + 1)
TIMES_S = np.array([0.0, 0.3, 0.7, 1.0, 1.4, 1.7, 2.1, 2.4, 2.8, 3.1, 3.5, 3.8, 4.2, 4.5, 4.9])
STIR, WALK = 1, 2
SHARES = np.array([
    [[0.5, 0.1], [0.4, 0.2], [0.3, 0.3], [0.2, 0.0]],
    [[0.2, 0.2], [0.1, 0.3], [0.6, 0.1], [0.3, 0.4]],
    [[0.3, 0.6], [0.25, 0.4], [0.1, 0.05], [0.0, 0.7]],
])  # fmt: skip
"""Of both lines at each step, of people who stand still, stir and walk. [G, P, L]."""


PRIOR = np.array([20.0, 100.0, 100.0])


def fitted(time_s, position, now_s, span_s):
    """Of a line through the last detections: position now, velocity, and how far it misses the last one."""
    late = time_s >= time_s[-1] - span_s - 1e-9
    velocity, there = np.polyfit(time_s[late] - now_s, position[late], 1)
    missed_m = np.linalg.norm(there + velocity * (time_s[-1] - now_s) - position[-1])
    return there, velocity, missed_m


def test_lines_are_fitted_to_the_last_detections():
    """Least squares over 2.5 and 0.7 s before the last detection, the limits included."""
    rng = np.random.default_rng(1)
    position = np.array([30.0, -8.0]) + TIMES_S[:, None] * [1.1, 0.4] + rng.normal(0, 0.1, (15, 2))
    count = (15, 8, 1)
    known = Detections(
        np.concatenate([TIMES_S[:k] for k in count]), np.repeat([3, 5, 8], count),
        np.concatenate([position[:k] for k in count]),
    )  # fmt: skip
    lines = known.lines(np.array([5, 3, 4, 8]), 5.2, np.array([2.5, 0.7]))
    for row, k in ((0, 8), (1, 15)):
        for line, span_s in enumerate((2.5, 0.7)):
            there, velocity, missed_m = fitted(TIMES_S[:k], position[:k], 5.2, span_s)
            np.testing.assert_allclose(lines.position[row, line], there)
            np.testing.assert_allclose(lines.velocity[row, line], velocity)
            np.testing.assert_allclose(lines.missed_m[row, line], missed_m)
    np.testing.assert_allclose(lines.followed_s, [2.4, 4.9, 0.0, 0.0])
    np.testing.assert_array_equal(lines.detections, [8, 15, 0, 1])
    for values in (lines.position, lines.velocity, lines.missed_m):
        assert np.isnan(values[2:]).all()
        assert np.isfinite(values[:2]).all()


def place_with(shares, compared=100.0):
    """Sums that lead to given shares: with A = 2 and N = 100, w = b / (2 (1 + M / N))."""
    products = np.broadcast_to(2.0 * np.eye(2), (*shares.shape, 2))
    return Sums(products, 2.0 * (1 + PRIOR[:, None, None] / compared) * shares, np.full(3, compared))


def trusting(shares=SHARES):
    """Trust at a place that has taught such shares, with nobody there."""
    return Trust.of_place(place_with(shares))


def forecasts_of(here, speed_mps):
    """Bent paths of two modes from some places, m. [N, 2], [N]."""
    bend = np.stack([AHEAD_S + 0.1 * AHEAD_S**2, -0.2 * AHEAD_S], axis=-1)
    point = here[:, None] + np.array(speed_mps)[:, None, None] * bend
    path = np.stack([point + np.array([0.1, -0.05]), point - AHEAD_S[:, None] * [0.3, 0.2]], axis=1)
    covariance = np.broadcast_to(0.1 * np.eye(2), (len(here), 2, STEPS, 2, 2))
    return Predictions(point, path, np.tile([0.7, 0.3], (len(here), 1)), DT_S, covariance)


def walked(rows, time_s=TIMES_S):
    """Detections of some people, m. [N, T, 2]."""
    rng = np.random.default_rng(7)
    way = np.array([[1.2, 0.1], [-0.4, 0.9], [0.02, 0.03]])[:rows, None] * time_s[:, None]
    begin = np.array([[12.0, -5.0], [20.0, 3.0], [-7.0, 1.0]])[:rows, None]
    return begin + way + rng.normal(0, 0.05, way.shape)


PEOPLE, SPEED_MPS = np.array([9, 4, 6]), [1.0, 0.8, 0.1]


def stepped(trust, time_s=TIMES_S, position=None, seen=None):
    """After each instant: trust, the network's forecasts, and those afterwards."""
    position, place = walked(3, time_s) if position is None else position, place_of(trust)
    for k, now_s in enumerate(time_s):
        there = np.ones(len(position), bool) if seen is None else seen[:, k]
        forecasts = forecasts_of(position[:, k], SPEED_MPS[: len(position)])
        known = now_s, PEOPLE[: len(position)], position[:, k], there
        place, after = at_instant(place, *known, forecasts)
        yield place, forecasts, after


def apart_from(forecasts, position, upto):
    """From the point forecasts to both lines [N, L, P, 2], and how far these count [N, L]."""
    apart, fits = np.empty((len(forecasts), 2, STEPS, 2)), np.empty((len(forecasts), 2))
    time_s = TIMES_S[:upto]
    for row, line in np.ndindex(fits.shape):
        there, velocity, missed_m = fitted(time_s, position[row, :upto], time_s[-1], (2.4, 0.6)[line])
        apart[row, line] = there + velocity * AHEAD_S[:, None] - forecasts.point[row]
        fits[row, line] = np.clip((0.5 - missed_m) / 0.25, 0, 1)
    return apart, fits


def test_forecasts_go_to_the_lines_by_their_shares():
    """n + sum_l w_l d_l; every mode goes there by the same shares: path + sum_l w_l (d_l + n - path).

    The last detections of the first two people are moved by 0.5 m, so that lines count partly. Shares of the
    one who stirs are others. Nobody has shares before 1.2 s; weights and covariances stay.
    """
    position = walked(3)
    position[:2, 4] += [[0.5, 0.3], [-0.2, 0.7]]
    instants = list(stepped(trusting(), TIMES_S[:5], position))
    for _, forecasts, after in instants[:4]:
        assert after is forecasts
    _, forecasts, after = instants[4]
    apart, fits = apart_from(forecasts, position, 5)
    assert ((fits[:2] > 0) & (fits[:2] < 1)).any()
    shares = SHARES[[WALK, WALK, STIR]] * fits[:, None]
    shift = np.einsum("npl,nlpa->npa", shares, apart)
    np.testing.assert_allclose(after.point, forecasts.point + shift)
    left = 1 - shares.sum(axis=-1)[:, None, :, None]
    expected = (forecasts.point + shift)[:, None] + left * (forecasts.path - forecasts.point[:, None])
    np.testing.assert_allclose(after.path, expected)
    np.testing.assert_array_equal(after.weight, forecasts.weight)
    np.testing.assert_array_equal(after.covariance, forecasts.covariance)


@pytest.mark.parametrize(("side_m", "counts"), [(0.24, 1.0), (0.375, 0.5), (0.51, 0.0)])
def test_a_line_that_misses_the_last_detection_counts_less(side_m, counts):
    """The short line is fitted to three detections at 0.8, 1.1 and 1.4 s, not to that at 0.76 s.

    A last detection that is s beside the others is missed by s / 6 of the short line; all are at one place.
    """
    time_s, shares = np.array([0.0, 0.76, 0.8, 1.1, 1.4]), np.zeros((3, STEPS, 2))
    shares[:, :, 1] = 0.5
    position = np.tile([3.0, 4.0], (1, 5, 1))
    position[0, 4, 1] += 6.0 * side_m
    *_, (_, forecasts, after) = stepped(trusting(shares), time_s, position)
    line_y = 4.0 + 5.0 * side_m + 6.0 * side_m / 0.6 * AHEAD_S
    moved = (after.point - forecasts.point)[0, :, 1]
    np.testing.assert_allclose(moved, 0.5 * counts * (line_y - forecasts.point[0, :, 1]), atol=1e-9)


def test_modes_do_not_go_to_a_line_that_is_unknown():
    """One detection within 0.6 s: of half a share of each line, that of the long one counts alone."""
    time_s, shares = np.array([0.0, 0.7, 1.4]), np.full((3, STEPS, 2), 0.5)
    position = np.array([[[3.0, 4.0], [3.7, 4.2], [4.4, 4.4]]])
    *_, (_, forecasts, after) = stepped(trusting(shares), time_s, position)
    line = position[0, -1] + AHEAD_S[:, None] * [1.0, 0.2 / 0.7]
    np.testing.assert_allclose(after.point[0], 0.5 * forecasts.point[0] + 0.5 * line)
    np.testing.assert_allclose(after.path[0], 0.5 * forecasts.path[0] + 0.5 * line)


def test_people_are_followed_for_1_2_s_before_lines_are_used():
    for first_s, last_s, used in ((0.0, 1.19, False), (0.0, 1.2, True), (1.1, 2.3, True)):
        time_s = np.array([first_s, first_s + 0.3, first_s + 0.8, last_s])
        *_, (_, forecasts, after) = stepped(trusting(), time_s)
        assert (after is not forecasts) == used


def test_forecasts_move_between_looks_too():
    """Instants 0.1 s apart: forecasts are kept each 0.3 s, and moved at all of them."""
    time_s = np.arange(0.0, 4.05, 0.1)
    instants = list(stepped(trusting(), time_s))
    waiting = [len(place.trust.past) for place, *_ in instants]
    np.testing.assert_array_equal(waiting[:24], 0)
    assert waiting[24:] == [1 + k // 3 for k in range(17)]
    assert [after is forecasts for _, forecasts, after in instants] == [True] * 12 + [False] * 29
    assert {place.looked_s for place, *_ in instants[24:27]} == {time_s[24]}


def sums_of(position, person, times):
    """What the forecasts of one of three people from some instants teach, with the shares of the place."""
    products, errors, group = np.zeros((STEPS, 2, 2)), np.zeros((STEPS, 2)), [WALK, WALK, STIR][person]
    for k in times:
        forecasts = forecasts_of(position[:, k], SPEED_MPS)
        apart, fits = apart_from(forecasts, position, k + 1)
        d, step_s = fits[person, :, None, None] * apart[person], TIMES_S[k] + AHEAD_S
        truth = np.stack([np.interp(step_s, TIMES_S, position[person, :, a]) for a in range(2)], axis=-1)
        e = truth - forecasts.point[person]
        left = np.linalg.norm(e - np.einsum("pl,lpa->pa", SHARES[group], d), axis=-1)
        products += np.einsum("p,lpa,mpa->plm", 1 / (0.02 + left), d, d)
        errors += np.einsum("p,lpa,pa->pl", 1 / (0.02 + left), d, e)
    return products, errors


def test_forecasts_are_compared_once_their_last_step_is_over():
    """Kept at 2.4, 2.8, 3.1, ... s, of people who have been followed for 2.4 s; due 1.6 + 0.2 s later."""
    position = walked(3)
    position[:2, 8] += [[0.4, 0.3], [-0.2, 0.6]]  # lines count partly
    instants = [place.trust for place, *_ in stepped(trusting(), position=position)]
    compared = [trust.sums.compared.sum(axis=-1).tolist() for trust in instants]
    assert compared == [[]] * 12 + [[1.0] * 3] * 2 + [[3.0] * 3]
    assert [len(trust.past) for trust in instants] == [0] * 7 + [1, 2, 3, 4, 5, 5, 6, 5]
    order = np.argsort(PEOPLE)
    for row, person in enumerate(order):
        group = [WALK, WALK, STIR][person]
        products, errors = sums_of(position, person, (7, 8, 9))
        np.testing.assert_allclose(instants[-1].sums.products[row, group], products)
        np.testing.assert_allclose(instants[-1].sums.errors[row, group], errors)
        assert not np.delete(instants[-1].sums.products[row], group, axis=0).any()
    np.testing.assert_array_equal(instants[-1].place.compared, [100.0] * 3)


@pytest.mark.parametrize("later_s", [1.7, 2.2, 3.9, 4.9])
def test_rounding_of_times_changes_no_comparison(later_s):
    """Differences of times are not exact: 4.1 - 1.7 is less than 2.4."""
    time_s = np.round(TIMES_S + later_s, 1)
    instants = [place.trust for place, *_ in stepped(trusting(), time_s)]
    assert [int(trust.sums.compared.sum()) for trust in instants] == [0] * 12 + [3, 3, 9]
    assert [len(trust.past) for trust in instants] == [0] * 7 + [1, 2, 3, 4, 5, 5, 6, 5]


def test_people_must_be_seen_and_detected_four_times_to_teach():
    """Seen at 0, 1.2, 2.4 s only; the second person also at 1.8 s; the third not at 2.4 s."""
    time_s = np.array([0.0, 1.2, 1.8, 2.4, 2.7])
    seen = np.array([[1, 1, 0, 1, 0], [1, 1, 1, 1, 0], [1, 1, 1, 0, 1]], bool)
    *_, before, after = (place.trust for place, *_ in stepped(trusting(), time_s, seen=seen))
    assert [kept.person.tolist() for kept in before.past] == [[PEOPLE[1]]]
    assert [kept.person.tolist() for kept in after.past] == [[PEOPLE[1]], [PEOPLE[2]]]


@pytest.mark.parametrize(("last_s", "gone"), [(7.48, False), (7.52, True)])
def test_people_who_left_teach_all_others(last_s, gone):
    """Who is not detected for longer than 1.6 + 1 s has left; what they taught is added to the place.

    From then on, also those who were there before have the new shares.
    """
    position, here = walked(3), np.zeros((1, 2))
    *_, (place, *_) = stepped(trusting(), position=position)
    known = here, np.array([True]), forecasts_of(here, [1.0])
    for now_s in (4.9, 5.8, 6.2, 6.6, 7.1, last_s):
        place, _ = at_instant(place, now_s + 0.01, np.array([20]), *known)
    trust = place.trust
    assert trust.person.tolist() == ([] if gone else [4, 6, 9])
    np.testing.assert_array_equal(trust.place.compared, [100.0, 103.0, 106.0] if gone else [100.0] * 3)
    if not gone:
        np.testing.assert_allclose(trust.weights, SHARES)
        return
    taught = [sums_of(position, person, (7, 8, 9)) for person in (0, 1)]
    products = 2.0 * np.eye(2) + taught[0][0] + taught[1][0]
    errors = 4.0 * SHARES[WALK] + taught[0][1] + taught[1][1]
    np.testing.assert_allclose(trust.place.products[WALK], products)
    np.testing.assert_allclose(trust.place.errors[WALK], errors)
    shares = best_weights(products * (1 + 100 / 106 * np.eye(2)), errors)
    np.testing.assert_allclose(trust.weights[WALK], shares)
    _, after = at_instant(place, 7.6, np.array([20]), *known)
    left = 1 - shares.sum(axis=-1)[:, None]  # both lines stay where the person stands
    np.testing.assert_allclose(after.point[0], left * known[2].point[0])


def test_what_somebody_has_shown_counts_three_times_for_itself():
    """Who walks and has taught the place nothing yet: sums of the place and three times its own."""
    position = walked(3)
    *_, (place, forecasts, after) = stepped(trusting(), position=position)
    np.testing.assert_allclose(place.trust.weights, SHARES)
    apart, fits = apart_from(forecasts, position, 15)
    for row, group in ((0, WALK), (1, WALK), (2, STIR)):
        products, errors = sums_of(position, row, (7, 8, 9))
        squares = (2.0 * np.eye(2) + 3 * products) * (1 + 100 / 109 * np.eye(2))
        shares = best_weights(squares, 4.0 * SHARES[group] + 3 * errors) * fits[row]
        assert (shares != SHARES[group] * fits[row]).any()
        shift = np.einsum("pl,lpa->pa", shares, apart[row])
        np.testing.assert_allclose(after.point[row], forecasts.point[row] + shift)


def test_who_stays_does_not_keep_back_what_others_taught():
    *_, (place, *_) = stepped(trusting())
    here, stays = np.zeros((1, 2)), np.array([6])
    for now_s in (5.3, 5.9, 6.5, 7.0, 7.6):
        place, _ = at_instant(place, now_s, stays, here, np.array([True]), forecasts_of(here, [0.1]))
    assert place.trust.person.tolist() == [6]
    np.testing.assert_array_equal(place.trust.place.compared, [100.0, 100.0, 106.0])


def test_who_is_not_seen_up_to_the_last_step_teaches_nothing():
    """The second person is last detected at 3.8 s; its forecast from 2.4 s ends at 4 s."""
    seen = np.ones((3, 15), bool)
    seen[1, 12:] = False
    *_, (place, *_) = stepped(trusting(), seen=seen)
    trust = place.trust
    np.testing.assert_array_equal(trust.sums.compared.sum(axis=-1), [0.0, 3.0, 3.0])
    assert trust.person.tolist() == sorted(PEOPLE)


def test_what_was_learned_is_kept_without_people():
    """What people have taught who are there counts, too, also after lists of numbers were written."""
    *_, (place, *_) = stepped(trusting())
    trust, left = place.trust, place.without_people()
    alone = left.trust
    np.testing.assert_array_equal(alone.place.compared, [100.0, 103.0, 106.0])
    np.testing.assert_allclose(alone.place.errors, trust.place.errors + trust.sums.errors.sum(axis=0))
    assert (alone.past, left.looked_s, len(alone.person)) == ((), -np.inf, 0)
    np.testing.assert_array_equal(alone.weights, alone.place.best_weights())
    again = Trust.initial(STEPS).restored(trust.plain())
    for one, other in zip(again.place, alone.place, strict=True):
        np.testing.assert_array_equal(one, other)
    with pytest.raises(ValueRuleError):
        Trust.initial(STEPS).restored(trust.plain() | {"compared": [-1.0, 0.0, 0.0]})
