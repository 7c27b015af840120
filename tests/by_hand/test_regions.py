"""Regions that learn from detections: a and b after each instant, their limits and their use, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.forecasting.regions import Regions
from pedpred.scenes import Predictions
from tests.learners import at_instant, place_of

STEPS, DT_S = 3, 0.4
TIMES_S = np.array([0.0, 0.3, 0.7, 1.0, 1.4, 1.8, 2.2, 2.6, 3.0, 4.5, 4.8, 5.2])
STAND, STIR, WALK = 0, 1, 2
PLACE = np.array([[15.0, -2.0], [18.0, 1.0]])


def steps_of(missed):
    """(z50 + z90 + z95) / 3 and ((z90 + z95) / 2 - z50) / 2 of somebody outside the first so many regions.

    z is -1, -1/3 and -0.05 / sqrt(0.0475) inside, and 1, 3 and 0.95 / sqrt(0.0475) outside.
    """
    inside, outside = [-1.0, -1 / 3, -0.05 / 0.0475**0.5], [1.0, 3.0, 0.95 / 0.0475**0.5]
    z50, z90, z95 = outside[:missed] + inside[missed:]
    return np.array([(z50 + z90 + z95) / 3, ((z90 + z95) / 2 - z50) / 2])


def missed_by(r):
    """How many regions do not reach r deviations: u = 1 - exp(-r^2 / 2) of a plane Gaussian."""
    return sum(1 - np.exp(-(r**2) / 2) > level for level in (0.5, 0.9, 0.95))


def single(away_m, deviation_m=0.2):
    """Forecasts of one mode for people at `PLACE` who will stand; wrong by so much along x. [N, P]."""
    away_m = np.asarray(away_m, np.float64)
    point = PLACE[: len(away_m), None] + away_m[..., None] * [1.0, 0.0]
    sigma = np.broadcast_to(deviation_m**2 * np.eye(2), (*away_m.shape, 2, 2))
    return Predictions.single(point, DT_S, sigma)


def stepped(regions, away_m, times_s=TIMES_S, seen=None):
    """After each instant: the place and the forecasts, of errors [T, N, P]."""
    place = place_of(regions)
    people = away_m.shape[1]
    for k, now_s in enumerate(times_s[: len(away_m)]):
        there = np.ones(people, bool) if seen is None else seen[k]
        known = now_s, 30 + np.arange(people), PLACE[:people], there
        place, after = at_instant(place, *known, single(away_m[k]))
        yield place, after


def due_at(times_s, at, step):
    """The first instant at which a step of a forecast can be compared: 0.2 s after its time; None: none."""
    late = np.flatnonzero(times_s > times_s[at] + DT_S * (step + 1) + 0.2 - 1e-9)
    return late[0] if len(late) else None


@pytest.mark.parametrize(
    ("steps", "compared"),
    [(10, [0, 1, 4, 9]), (3, [0, 1, 2]), (1, [0]), (12, [0, 1, 4, 11]), (30, [0, 2, 9, 29])],
)
def test_four_steps_of_the_horizon_are_compared(steps, compared):
    """1, P^(1/3), P^(2/3), P, rounded; each once."""
    regions = Regions.initial(steps)
    np.testing.assert_array_equal(regions.steps, compared)
    np.testing.assert_array_equal(regions.learned, np.zeros((2, 3, len(compared))))


@pytest.mark.parametrize(
    ("group", "error_m"),
    [(STAND, [0.13, -0.1, 0.15]), (STIR, [0.0, -0.1, 0.15]), (WALK, [-0.2, 0.05, 0.3])],
)
def test_a_and_b_after_each_instant(group, error_m):
    """Of somebody who is forecast to stand, to stir, or to walk, with a deviation of 0.2 m.

    Forecasts are kept from the fourth detection on. Those of a step that are due gain 0.075 for each second
    since the last look, at most for 1 s. Of one mode, b plays no part in the comparison: its deviation is
    that of the forecast times exp(0.8 (a now - a then)). Between 3 and 4.5 s nobody knows where the person
    is: forecasts whose steps end there have taught nothing.
    """
    away_m = np.random.default_rng(6).uniform(0.1, 0.6, (len(TIMES_S), 1, 1)) + error_m
    learned, kept, taught, looks = np.zeros((2, STEPS)), [], {}, []
    for k, (place, after) in enumerate(stepped(Regions.initial(STEPS), away_m)):
        regions = place.regions
        due = [one for one in kept if due_at(TIMES_S, *one[:2]) == k]
        kept, by = [one for one in kept if one not in due], np.zeros((2, STEPS))
        for at, p, a_then in due:
            r = abs(away_m[at, 0, p]) / (0.2 * np.exp(a_then + 0.8 * (learned[0, p] - a_then)))
            own = taught.setdefault(at, np.zeros((2, STEPS)))
            own[:, p] = 0.075 * min(TIMES_S[k] - TIMES_S[k - 1], 1.0) * steps_of(missed_by(r))
            by[:, p] += own[:, p]
        for at in {at for at, p, _ in due if 3.0 < TIMES_S[at] + DT_S * (p + 1) < 4.5}:
            by -= taught.pop(at)
        learned = learned + by
        kept += [(k, p, learned[0, p]) for p in range(STEPS)] if k >= 3 else []
        looks.append((len(due), len(regions.pending)))
        np.testing.assert_allclose(regions.learned[:, group], learned, atol=1e-12)
        assert not np.delete(regions.learned, group, axis=1).any()
        np.testing.assert_allclose(after.covariance[0, 0, :, 0, 0], 0.04 * np.exp(2 * learned[0]))
    assert looks[3:] == [(0, 3), (0, 6), (1, 8), (2, 9), (3, 9), (3, 9), (9, 3), (0, 6), (1, 8)]
    assert (np.abs(learned[0]) > 0.005).all()


def test_two_instants_within_0_3_s_are_one_look():
    """At 10 Hz, forecasts are kept every 0.3 s; the first at 0.3 s, of people with four detections."""
    away_m = np.full((14, 1, STEPS), 0.1)
    instants = list(stepped(Regions.initial(STEPS), away_m, np.arange(14) * 0.1))
    assert [place.regions.made for place, _ in instants] == [0] * 3 + [1] * 3 + [2] * 3 + [3] * 3 + [4] * 2
    gain = 0.3 * 0.075 * steps_of(0)
    np.testing.assert_allclose(instants[11][0].regions.learned[:, STAND, 0], gain)
    np.testing.assert_array_equal(instants[8][0].regions.learned, 0.0)
    known = [len(place.detections.time_s) for place, _ in instants]
    assert known == list(range(1, 15))


def test_detections_of_the_last_4_s_are_known():
    """Of the four detections at the look at 4.6 s, two are kept; too few at the next ones."""
    times_s = np.array([0.0, 0.3, 0.7, 4.6, 4.9, 5.3])
    instants = list(stepped(Regions.initial(STEPS), np.full((6, 1, STEPS), 0.1), times_s))
    assert [len(place.detections.time_s) for place, _ in instants] == [1, 2, 3, 2, 2, 3]
    assert [place.regions.made for place, _ in instants] == [0, 0, 0, 1, 1, 1]


@pytest.mark.parametrize(("last", "lasting"), [(5, 0), (6, 1), (7, 2)])
def test_what_people_taught_is_taken_back_if_they_are_lost(last, lasting):
    """The second person is always wrong, and last detected at 1.8, 2.2 or 2.6 s.

    Forecasts from 1.0 and 1.4 s count in the end if their last steps, 1.2 s later, are over by then. The
    first person is always right and stays.
    """
    times_s = np.array([0.0, 0.3, 0.7, 1.0, 1.4, 1.8, 2.2, 2.6, 3.0, 3.3, 3.7, 4.1, 4.4])
    away_m, seen = np.zeros((13, 2, STEPS)), np.ones((13, 2), bool)
    away_m[:, 1], seen[last + 1 :, 1] = 50.0, False
    instants = list(stepped(Regions.initial(STEPS), away_m, times_s, seen))
    expected = np.zeros((2, STEPS))
    for at in range(3, 13):
        for p in range(STEPS):
            if look := due_at(times_s, at, p):
                gain = 0.075 * (times_s[look] - times_s[look - 1])
                expected[:, p] += gain * (steps_of(0) + (at < 3 + lasting) * steps_of(3))
    np.testing.assert_allclose(instants[-1][0].regions.learned[:, STAND], expected, atol=1e-12)
    assert instants[8][0].regions.learned[0, STAND, 0] > expected[0, 0]


def test_what_two_people_taught_is_taken_back_at_one_look():
    """Of forecasts from 0.9 s, the steps at 2.3 s and at 3.0 s are both due at the look at 3.25 s.

    The second person is not seen from 1.78 to 2.785 s, so that 2.3 s alone is unknown, and the first one not
    after 2.49 s, so that 3.0 s is. In the end, no forecast is left that was known at all its steps.
    """
    times_s = 0.0, 0.3, 0.6, 0.9, 1.3, 1.78, 2.1, 2.49, 2.785, 3.25, 3.6
    who = "AB", "AB", "AB", "AB", "AB", "AB", "A", "A", "B", "B", "B"
    place, point = place_of(Regions.initial(4)), np.repeat(PLACE[:, None], 4, axis=1)
    forecasts, learned = Predictions.single(point, 0.7, np.broadcast_to(np.eye(2), (2, 4, 2, 2))), []
    for now_s, seen in zip(times_s, who, strict=True):
        known = np.array([30, 31]), PLACE, np.array(["A" in seen, "B" in seen])
        place, _ = at_instant(place, now_s, *known, forecasts)
        learned.append(place.regions.learned[0, STAND, 0])
    assert learned[6] == pytest.approx(2 * 0.32 * 0.075 * steps_of(0)[0])
    np.testing.assert_allclose(place.regions.learned, 0.0, atol=1e-12)


def test_later_steps_do_not_count_once_a_person_was_lost():
    """Not detected from 0.9 to 2.0 s: of the forecast from 0.9 s, the third step, 2.1 s, is known again."""
    times_s = np.array([0.0, 0.3, 0.6, 0.9, 1.3, 1.6, 2.0, 2.3])
    seen = np.array([1, 1, 1, 1, 0, 0, 1, 1], bool)[:, None]
    instants = list(stepped(Regions.initial(STEPS), np.full((8, 1, STEPS), 0.5), times_s, seen))
    for place, _ in instants:
        np.testing.assert_array_equal(place.regions.learned, 0.0)
    lost = [place.regions.lost.tolist() for place, _ in instants]
    assert lost == [[]] * 5 + [[0], [0], []]
    assert not len(instants[5][0].without_people().regions.lost)


def test_each_forecast_has_a_number_of_its_own():
    """Of one person, then of two."""
    seen = np.ones((12, 2), bool)
    seen[:3, 1] = False
    *_, (place, _) = stepped(Regions.initial(STEPS), np.zeros((9, 2, STEPS)), seen=seen)
    numbers = np.concatenate([one.forecast for one in place.regions.pending if one.step == 2])
    assert len(set(numbers.tolist())) == len(numbers) == 7
    assert place.regions.made == 9


@pytest.mark.parametrize(("away_m", "a", "b"), [(9.0, 1.0, 2.0), (0.0, -3.0, None), (0.3, None, -0.3)])
@pytest.mark.parametrize("on_lines", [False, True])
def test_a_and_b_have_limits(away_m, a, b, on_lines):
    """a stays between -3 and 1, b between -0.3, or -0.45 where modes were moved to lines, and 2.

    Both grow while people are outside of all regions, a falls while they are inside, and b while they are
    between those of 50 and 90 %.
    """
    b = -0.45 if b == -0.3 and on_lines else b
    learned = np.zeros((2, 3, STEPS))
    learned[0], learned[1] = 0.998 * (a or 0.0), 0.998 * (b or 0.0)
    regions = replace(Regions.initial(STEPS, on_lines=on_lines), learned=learned)
    *_, (place, _) = stepped(regions, np.full((8, 1, STEPS), away_m))
    for found, limit in zip(place.regions.learned[:, STAND], (a, b), strict=True):
        assert limit is None or found.tolist() == [limit] * STEPS
    np.testing.assert_array_equal(place.regions.learned[:, WALK], learned[:, WALK])


def learned_of(steps):
    """a and b of all groups at the compared steps."""
    regions = Regions.initial(steps)
    values = np.arange(1.0, 6.0 * len(regions.steps) + 1).reshape(2, 3, -1) / 30
    return replace(regions, learned=values * np.array([1.0, -0.3])[:, None, None])


def test_between_compared_steps_a_and_b_are_interpolated():
    """At steps 1, 2, 5 and 10 of ten; deviations of mode k are multiplied by exp(a + b (2 t_k - 1))."""
    regions, point = learned_of(10), np.zeros((2, 10, 2))
    point[1, :, 0] = 0.3 * np.arange(10)
    sigma = np.random.default_rng(8).uniform(0.1, 0.2, (2, 2, 10))[..., None, None] * np.eye(2)
    weight = np.array([[0.75, 0.25], [0.6, 0.4]])
    given = Predictions(point, np.stack([point, point + 1], axis=1), weight, 0.3, sigma)
    after = regions.scaled(given)
    for row, group in ((0, STAND), (1, WALK)):
        a, b = ([v[0], v[1], *np.linspace(v[1], v[2], 4)[1:], *np.linspace(v[2], v[3], 6)[1:]]
                for v in regions.learned[:, group])  # fmt: skip
        t = np.array([weight[row, 0] / 2, weight[row, 0] + weight[row, 1] / 2])
        factor = np.exp(2 * (np.array(a) + np.array(b) * (2 * t[:, None] - 1)))
        np.testing.assert_allclose(after.covariance[row], factor[..., None, None] * sigma[row])
    np.testing.assert_array_equal(after.path, given.path)
    assert Regions.initial(10).scaled(given) is given


def test_modes_to_walk_off_are_never_narrowed():
    """Of somebody who stands: modes of 0, 0.2 and 1 m/s; a = -1 of all groups, then a = 0.5."""
    way = np.arange(4.0)[:, None] * [0.4, 0.0]
    path = np.stack([0.0 * way, 0.2 * way, way])[None]
    sigma = np.broadcast_to(0.04 * np.eye(2), (1, 3, 4, 2, 2))
    given = Predictions(path[:, 0], path, np.array([[0.9, 0.08, 0.02]]), 0.4, sigma)
    for a, factors in ((-1.0, [np.exp(-2.0), 1.0, 1.0]), (0.5, [np.exp(1.0)] * 3)):
        regions = Regions.initial(4)
        learned = np.zeros_like(regions.learned)
        learned[0] = a
        found = replace(regions, learned=learned).scaled(given).covariance[0]
        np.testing.assert_allclose(found, np.array(factors)[:, None, None, None] * sigma[0])


def test_no_deviation_shrinks_below_a_quarter_of_the_noise():
    """0.2 m shrinks by exp(-2) to 0.027 m, with a noise of 0.2 m to 0.05 m."""
    for noise_m, expected_m in ((0.0, 0.2 * np.exp(-2)), (0.2, 0.05), (0.08, 0.2 * np.exp(-2))):
        regions = replace(
            Regions.initial(STEPS, noise_m), learned=np.full((2, 3, STEPS), [[[-2.0]], [[0.0]]])
        )
        found = regions.scaled(single(np.zeros((1, STEPS)))).covariance
        np.testing.assert_allclose(found[0, 0], np.tile(expected_m**2 * np.eye(2), (STEPS, 1, 1)))


def test_declared_noise_is_no_error_of_the_forecast():
    """0.3 m from a forecast of 0.2 m is outside of the half, and with a noise of 0.2 m inside."""
    for noise_m, missed in ((0.0, 1), (0.2, 0)):
        *_, (place, _) = stepped(Regions.initial(STEPS, noise_m), np.full((6, 1, STEPS), 0.3))
        np.testing.assert_allclose(place.regions.learned[:, STAND, 0], 0.4 * 0.075 * steps_of(missed))


def test_what_was_learned_is_kept_without_people():
    *_, (place, _) = stepped(Regions.initial(STEPS, 0.1, on_lines=True), np.full((9, 1, STEPS), 0.5))
    regions, left = place.regions, place.without_people()
    assert len(regions.adjustment.step)
    alone = left.regions
    assert (len(alone.adjustment.step), len(left.detections.time_s), alone.pending) == (0, 0, ())
    assert (left.looked_s, alone.noise_m, alone.on_lines) == (-np.inf, 0.1, True)
    again = Regions.initial(STEPS).restored(alone.plain())
    np.testing.assert_array_equal(again.learned, regions.learned)
    np.testing.assert_array_equal(regions.plain()["learned"], regions.learned)


@pytest.mark.parametrize(
    ("a", "b", "right"),
    [(-3.0, -0.45, True), (1.0, 2.0, True), (-3.1, 0.0, False), (1.1, 0.0, False), (0.0, -0.5, False),
     (0.0, 2.1, False)],
)  # fmt: skip
def test_learned_values_of_others_keep_to_the_wider_limits(a, b, right):
    """Of a robot that moves modes to lines b may be -0.45; one that does not starts at -0.3."""
    plain = {"learned": np.broadcast_to(np.array([a, b])[:, None, None], (2, 3, STEPS)).tolist()}
    for on_lines in (False, True):
        initial = Regions.initial(STEPS, on_lines=on_lines)
        if right:
            expected = [a, b if on_lines else max(b, -0.3)]
            np.testing.assert_array_equal(initial.restored(plain).learned[:, WALK, 1], expected)
        else:
            with pytest.raises(ValueRuleError):
                initial.restored(plain)
