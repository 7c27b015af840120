"""Errors of earlier forecasts nearby correct later ones: the sums, what is kept, and when, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.forecasting.detections import Detections, Instant
from pedpred.forecasting.local_errors import LocalErrors, Means, Waiting
from pedpred.forecasting.postprocessing import Postprocessing
from pedpred.online.correction import Correction
from pedpred.scenes import Predictions
from tests.learners import along, at_instant

STEPS, DT_S = 4, 0.5
PEOPLE = np.array([3, 8])


def shift_by_formula(start, way, error, at, going, own=0):
    """The equations of the module for one forecast, from single errors, the last ones its `own`. [P, 2]."""
    alike = np.repeat([12.0, 48.0], [len(start) - own, own])
    near = 1 - (((at - start) ** 2).sum(axis=1) + ((going - way) ** 2).sum(axis=1)) / 2.0**2
    w = np.maximum(near, 0) ** 2
    s = w.sum()
    m = (w[:, None, None] * error).sum(axis=0) / s
    v = (w[:, None] * ((error - m) ** 2).sum(axis=2)).sum(axis=0) / s + 1e-6
    n = s**2 / (alike * w**2).sum()
    size = (m**2).sum(axis=1)
    return m * (s / (s + 3) * size / (size + v / n))[:, None]


def shifts(means, start, way, waiting=None, person=None):
    """What such errors add to forecasts of somebody of whom none wait, or of some people. [N, P, 2]."""
    errors = LocalErrors(means, Waiting.empty(means.error.shape[1]) if waiting is None else waiting)
    return errors.shifts(np.full(len(start), 99) if person is None else person, start, way)


def apart():
    """Starts, ways and errors, no two of which are kept as one."""
    rng = np.random.default_rng(7)
    start = np.array([[0.0, 0.0], [0.9, 0.0], [0.0, 0.9], [-1.0, 0.2], [0.0, 0.0], [1.6, 0.9], [9.0, 0.0]])
    way = np.array([[1.0, 0.0], [1.0, 0.1], [0.9, 0.0], [1.0, 0.0], [0.1, 0.5], [1.0, 0.0], [1.0, 0.0]])
    return start, way, rng.normal([0.3, -0.2], 0.1, (7, STEPS, 2))


def test_shift_is_a_shrunk_mean_of_errors_nearby():
    start, way, error = apart()
    means = Means.empty(STEPS).with_errors(start, way, error)
    assert len(means.number) == 7
    at, going = np.array([[0.2, 0.1], [1.0, 0.5]]), np.array([[1.0, 0.0], [0.6, 0.2]])
    found = shifts(means, at, going)
    for row in range(2):
        np.testing.assert_allclose(found[row], shift_by_formula(start, way, error, at[row], going[row]))
    assert not shifts(means, np.array([[5.0, 5.0], [0.0, 0.0]]), np.array([[1.0, 0.0], [-2.0, 0.0]])).any()


def test_own_errors_that_wait_count_at_once():
    """Of three people with errors nearby, each is shifted by the means and its own errors alone."""
    start, way, error = apart()
    means, person = Means.empty(STEPS).with_errors(start[:3], way[:3], error[:3]), np.array([4, 6, 4])
    waiting = Waiting(person, np.zeros(3), start[3:6], way[3:6], error[3:6])
    at, going = np.tile([0.2, 0.1], (3, 1)), np.tile([0.9, 0.1], (3, 1))
    found = shifts(means, at, going, waiting, np.array([6, 4, 5]))
    for row, own in ((0, [4]), (1, [3, 5]), (2, [])):
        rows = [0, 1, 2, *own]
        known = start[rows], way[rows], error[rows]
        np.testing.assert_allclose(found[row], shift_by_formula(*known, at[row], going[row], len(own)))
    alone = shifts(Means.empty(STEPS), at, going, waiting, np.array([6, 4, 5]))
    known = start[[3, 5]], way[[3, 5]], error[[3, 5]]
    np.testing.assert_allclose(alone[1], shift_by_formula(*known, at[1], going[1], own=2))
    assert not alone[2].any()


def test_similar_errors_are_kept_as_one():
    """Within 0.8 m in (x, d); the nearest mean takes an error in, and moves."""
    start = np.array([[0.0, 0.0], [1.4, 0.0], [0.6, 0.0], [0.3, 0.0]])
    way, error = np.zeros((4, 2)), np.zeros((4, 1, 2))
    error[:, 0] = [[1.0, 0.0], [5.0, 0.0], [2.0, 1.0], [3.0, -1.0]]
    way[3] = [0.0, 0.6]
    means = Means.empty(1).with_errors(start, way, error)
    np.testing.assert_allclose(means.start, [[0.3, 0.0], [1.4, 0.0]])  # 0, .6 and .3
    np.testing.assert_allclose(means.way, [[0.0, 0.2], [0.0, 0.0]])
    np.testing.assert_allclose(means.error[:, 0], [[2.0, 0.0], [5.0, 0.0]])
    np.testing.assert_allclose(means.square[:, 0], [(1 + 5 + 10) / 3, 25.0])
    np.testing.assert_array_equal(means.number, [3, 1])
    np.testing.assert_array_equal(means.latest, [4, 2])
    border = Means.empty(1).with_errors(np.array([[0.0, 0.0], [0.8, 0.0]]), way[:2], error[:2])
    assert len(border.number) == 2


def test_a_mean_counts_as_so_many_similar_errors():
    """Ten equal errors in one place shift like the formula for ten."""
    start, way, error = (np.repeat(values[:1], 10, axis=0) for values in apart())
    found = shifts(Means.empty(STEPS).with_errors(start, way, error), start[:1], way[:1])[0]
    np.testing.assert_allclose(found, shift_by_formula(start, way, error, start[0], way[0]))


def test_old_errors_of_a_mean_fade():
    """After 200 errors, each new one counts a 200th."""
    nowhere = np.zeros((250, 2))
    error = np.ones((250, 1, 2))
    error[200:] = 2.0
    means = Means.empty(1).with_errors(nowhere, nowhere, error)
    np.testing.assert_allclose(means.error[0, 0], 2 - (1 - 1 / 200) ** 50)
    assert means.number == 200


def test_the_mean_unused_for_longest_is_forgotten():
    """A thousand are kept."""
    start = np.stack([np.arange(1000.0), np.zeros(1000)], axis=1)
    error = np.zeros((1000, 1, 2))
    means = Means.empty(1).with_errors(start, start, error)
    means = means.with_errors(start[:1], start[:1], error[:1])  # the second is the oldest now
    means = means.with_errors(np.full((1, 2), -50.0), np.zeros((1, 2)), error[:1])
    assert len(means.number) == 1000
    np.testing.assert_array_equal(means.start[:3], [[0, 0], [-50, -50], [2, 0]])
    np.testing.assert_array_equal(means.number[:3], [2, 1, 1])


def stream():
    """Detections every 0.3 s: 3 stays at (0, 0), 8 walks at 2 m/s from (30, 0), until 6 s; 9 until 12 s."""
    time_s = np.repeat(0.3 * np.arange(41), 3)
    person = np.tile([3, 8, 9], 41)
    x_m = np.select([person == 3, person == 8], [0.0, 30.0 + 2.0 * time_s], 200.0)
    there = (person == 9) | (time_s < 6.1)
    return person[there], time_s[there], np.stack([x_m, np.zeros(len(x_m))], axis=1)[there]


def ahead(detection):
    """Forecasts that everybody walks at 1 m/s along x, 0.2 m to the left of where they are; 9 stands."""
    way = np.stack([0.5 * np.arange(1, STEPS + 1), np.full(STEPS, 0.2)], axis=1)
    walks = detection[:, 0] < 150.0
    return Predictions.single(detection[:, None] + walks[:, None, None] * way, DT_S)


def places(person, time_s, detection, seen=None, forecasts=None):
    seen = np.ones(len(person), bool) if seen is None else seen
    forecasts = ahead(detection) if forecasts is None else forecasts
    return list(along(LocalErrors.initial(STEPS), person, time_s, detection, seen, forecasts))


@pytest.fixture(scope="module")
def taught():
    """The place after 12 s."""
    return places(*stream())[-1][0]


def test_errors_wait_until_their_person_has_left():
    """Forecasts from 0.9 s on (four detections) to 2 s ahead are compared 0.2 s later, at 3.3 s at first.

    The last one with detections up to its end is from 3.9 s. Both have left when the last detection, at 6 s,
    is more than the 2 s of the horizon and 1 s ago.
    """
    person, time_s, detection = stream()
    for (place, _), now_s in zip(places(person, time_s, detection), np.unique(time_s), strict=True):
        compared = np.clip(np.floor((now_s - 2.2 - 0.9) / 0.3 + 1e-6) + 1, 0, 11)
        errors = place.local_errors
        left = now_s > 9.1
        assert len(errors.waiting.person) == (0 if left else 2 * compared)
        assert errors.means.number.sum() == (22 if left else 0)
        assert errors.without_people().means.number.sum() == 2 * compared


def test_people_who_are_there_are_shifted_by_their_own_errors():
    """From 3.3 s on, when the first ones are compared, who stays; who walks at 2 m/s is 4.8 m from these."""
    person, time_s, detection = stream()
    for (_, changed), now_s in zip(places(person, time_s, detection), np.unique(time_s), strict=True):
        rows = time_s == now_s
        moved = (changed.point != ahead(detection[rows]).point).any(axis=(1, 2))
        np.testing.assert_array_equal(moved, (person[rows] == 3) & (now_s > 3.2))


def test_who_has_left_teaches_while_others_wait():
    """3 leaves after 6 s, 8 is followed to the end."""
    person, time_s, _ = stream()
    more_s = time_s[(person == 9) & (time_s > 6.1)]
    person, time_s = np.append(person, np.full(len(more_s), 8)), np.append(time_s, more_s)
    order = np.lexsort((person, time_s))
    person, time_s = person[order], time_s[order]
    x_m = np.select([person == 3, person == 8], [0.0, 30.0 + 2.0 * time_s], 200.0)
    place, _ = places(person, time_s, np.stack([x_m, np.zeros(len(x_m))], axis=1))[-1]
    assert place.local_errors.means.number.sum() == 11
    assert (place.local_errors.means.start[:, 0] == 0.0).all()
    assert np.unique(place.local_errors.waiting.person) == 8


def test_error_is_where_somebody_was_minus_the_forecast(taught):
    """Forecast to walk 0.5 m a step, one stays, the other walks 1 m a step."""
    means, step_m = taught.local_errors.means, 0.5 * np.arange(1, STEPS + 1)
    stays = means.start[:, 0] < 1
    assert stays.any()
    assert (~stays).sum() > 1
    for rows, along_m in ((stays, -step_m), (~stays, step_m)):
        np.testing.assert_allclose(means.error[rows, :, 0], [along_m] * rows.sum())
        np.testing.assert_allclose(means.error[rows, :, 1], -0.2)
    np.testing.assert_allclose(means.way, [[2.0, 0.2]] * len(means.way))


def test_who_comes_later_is_shifted_unless_forecast_to_stand(taught):
    """Slower than 0.3 m/s: 0.4 m in the 1.5 s between the first step and the last."""
    here = np.array([[0.0, 0.0], [34.0, 0.0], [34.0, 0.0]])
    plain = ahead(here).point
    plain[2, :, 0] = 34.0 + np.linspace(0.0, 0.4, STEPS)
    known = np.array([20, 21, 22]), here, np.ones(3, bool)
    _, changed = at_instant(taught, 12.1, *known, Predictions.single(plain, DT_S))
    shift = shifts(taught.local_errors.means, here, plain[:, -1] - here)
    assert shift.all()
    np.testing.assert_allclose(changed.point[:2], (plain + shift)[:2])
    np.testing.assert_allclose(changed.path[:2, 0], (plain + shift)[:2])
    np.testing.assert_array_equal(changed.point[2], plain[2])


@pytest.mark.parametrize("what", ["unseen", "lost", "standing"])
def test_unknown_errors_and_standing_people_teach_nothing(what):
    """People who are extrapolated when forecast, not detected up to the last step, or forecast to stand."""
    person, time_s, detection = stream()
    seen, forecasts = np.ones(len(person), bool), ahead(detection)
    if what == "unseen":
        seen[person == 3] = False
    if what == "standing":
        point = forecasts.point.copy()
        point[person == 3, :, 0] = np.linspace(0.0, 0.4, STEPS)
        forecasts = Predictions.single(point, DT_S)
    if what == "lost":
        there = (person != 3) | (time_s < 2.8)  # the forecast from 0.9 s would end at 2.9 s
        person, time_s, detection, seen = (values[there] for values in (person, time_s, detection, seen))
        forecasts = forecasts.select(there)
    place, _ = places(person, time_s, detection, seen, forecasts)[-1]
    assert len(place.local_errors.means.number)
    assert (place.local_errors.means.start[:, 0] > 20).all()


def test_errors_of_who_stays_for_a_minute_are_dropped():
    errors = places(*stream())[13][0].local_errors  # 3.9 s: six errors wait, the oldest since 3.3 s
    assert len(errors.waiting.person) == 6
    for now_s, left in ((63.2, 6), (63.4, 4)):
        known = Detections(np.full(2, now_s), PEOPLE, np.zeros((2, 2)))
        now = Instant(now_s, PEOPLE, np.zeros(2, bool), known, -np.inf)
        after, _ = replace(errors, past=()).update(now, ahead(np.zeros((2, 2))), np.zeros((2, 2)))
        assert (len(after.waiting.person), len(after.means.number)) == (left, 0)


def test_local_errors_turn_with_the_world_frame():
    """A corrected world gives the corrected forecasts."""
    place = places(*stream())[15][0]
    correction = Correction(0.7, np.array([5.0, -2.0]))
    moved, errors = correction.of_place(place).local_errors, place.local_errors
    here, way = np.array([[0.1, 0.0], [33.0, 0.0]]), np.array([[2.0, 0.2], [2.0, 0.2]])
    expected = shifts(errors.without_people().means, here, way)
    assert expected.any(axis=(1, 2)).all()
    turn = np.array([[np.cos(0.7), np.sin(0.7)], [-np.sin(0.7), np.cos(0.7)]])
    there = here @ turn + correction.shift
    np.testing.assert_allclose(shifts(moved.without_people().means, there, way @ turn), expected @ turn)
    later = correction.of_place(replace(place, local_errors=errors.without_people())).local_errors
    np.testing.assert_allclose(shifts(later.means, there, way @ turn), expected @ turn)
    for name in ("start", "point"):
        was, now = getattr(errors.past[0], name), getattr(moved.past[0], name)
        np.testing.assert_allclose(now, was @ turn + correction.shift)


def test_restored_local_errors_shift_alike():
    """Errors that wait are written as if everybody had left."""
    errors, initial = places(*stream())[15][0].local_errors, LocalErrors.initial(STEPS)
    again, left = initial.restored(errors.plain()), errors.without_people()
    here, way = np.array([[0.1, 0.0]]), np.array([[2.0, 0.2]])
    assert shifts(left.means, here, way).all()
    np.testing.assert_array_equal(shifts(again.means, here, way), shifts(left.means, here, way))
    assert again.past == left.past == ()
    assert len(again.waiting.person) == len(left.waiting.person) == 0
    assert len(initial.restored(initial.plain()).means.number) == 0
    for wrong in ({"number": [1.0] * 1001}, {"number": [201.0]}, {"square": [[0.0] * STEPS]}):
        one = Means.empty(STEPS).with_errors(here, way, np.ones((1, STEPS, 2)))
        with pytest.raises(ValueRuleError):
            initial.restored(replace(initial, means=one).plain() | wrong)


def test_local_errors_are_a_link_of_their_own():
    """Off unless asked for; what is learned shifts point and modes."""
    assert Postprocessing().initial(STEPS).local_errors is None
    link = Postprocessing(local_errors=True, learning=False)
    here, way = np.zeros((1, 2)), np.array([[2.0, 0.2]])
    taught = Means.empty(STEPS).with_errors(here, way, np.ones((1, STEPS, 2)))
    place = replace(link.initial(STEPS), local_errors=replace(LocalErrors.initial(STEPS), means=taught))
    _, found = link.apply(place, ahead(here), here, 0.0, np.array([3]), here, np.ones(1, bool))
    shift = shifts(taught, here, way)
    assert shift.all()
    np.testing.assert_allclose(found.point, ahead(here).point + shift)
