"""Errors of earlier forecasts nearby, learned at a place, from which later forecasts are corrected.

A network does not know where at this place people turn, stop, or go round what no map shows; those who come
later mostly do the same. So everybody's forecast is kept now and then, and compared with where the person was
detected later. Let x be where a person is, d the way to the end of the point forecast, and e_j the error of
an earlier forecast at a step, from x_j along d_j. Later forecasts move at that step by
    w_j = max(0, 1 - (|x - x_j|^2 + |d - d_j|^2) / R^2)^2,    s = sum_j w_j,    m = sum_j w_j e_j / s
    v = sum_j w_j |e_j - m|^2 / s,    n = s^2 / (A sum_j w_j^2)
    shift = m . s / (s + N) . |m|^2 / (|m|^2 + v / n)
which is a kernel regression of the errors (Nadaraya 1964, Watson 1964). It is drawn to 0 where few errors
are known, as N errors of 0 would, and where the mean is not larger than its own spread; A errors of people
who walk together, or of one person shortly after each other, count as one. Every mode moves by the same
shift, so regions keep their shape. People who are not forecast to walk neither teach nor are they moved.

What somebody does changes no forecast of others before it has left: errors of a person count for all from
then on, and for itself at once, with a larger A, since people in a queue or on laps repeat what they did.
Similar errors are kept as one, by their mean and mean square, so that memory stays bounded for hours; where
there are too many, those that were not added to for longest are forgotten. The world frame must stay where it
is. Forecasts of people who are not seen up to the last step do not number, as in the evaluation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from pedpred.compiled import compiled
from pedpred.errors import ValueRuleError
from pedpred.forecasting.detections import KNOWN, LEFT_AFTER_S, NEAR_S, Instant, is_in_sorted
from pedpred.forecasting.groups import WALKING, groups_of
from pedpred.scenes import Predictions
from pedpred.settings import finite
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_REACH_M = 2.0
"""R."""
_PRIOR, _ALIKE, _ALIKE_OWN = 3.0, 12.0, 48.0
"""N, A, and how many of a person's own latest errors count as one: their horizons overlap."""
_SAME_M = 0.8
"""Errors of forecasts that are nearer to each other than this in (x, d), m, are kept as one."""
_MOST, _LARGEST = 1000, 200.0
"""Kept means, and the most errors that one counts: the mean then fades."""
_WAIT_S = 60.0
"""Errors of people who stay for longer are dropped, s, so that memory stays bounded."""
_ROUNDING = 1e-9
_LEAST_M2 = 1e-6
"""Variance of errors at the least, m^2: errors of detections that are written in millimetres."""


class Means(NamedTuple):
    """Errors of similar forecasts, as one each.

    Attributes:
        start: mean of x, world frame, m. [M, 2]
        way: mean of d, m. [M, 2]
        error: mean of the errors at each step, m. [M, P, 2]
        square: mean of their squares, m^2. [M, P]
        number: of errors. [M]
        latest: which of all comparisons was the last one that added to it. [M]
    """

    start: np.ndarray
    way: np.ndarray
    error: np.ndarray
    square: np.ndarray
    number: np.ndarray
    latest: np.ndarray

    @classmethod
    def empty(cls, steps: int, rows: int = 0) -> Means:
        """Zeros for some rows."""
        shapes = (rows, 2), (rows, 2), (rows, steps, 2), (rows, steps), (rows,), (rows,)
        return cls(**{name: np.zeros(shape) for name, shape in zip(cls._fields, shapes, strict=True)})

    def with_errors(self, start: np.ndarray, way: np.ndarray, error: np.ndarray) -> Means:
        """After some more comparisons.

        Args:
            start: x, world frame, m. [N, 2]
            way: d, m. [N, 2]
            error: at each step, m. [N, P, 2]
        """
        kept = len(self.number)
        room = Means.empty(error.shape[1], min(_MOST, kept + len(start)))
        for new, old in zip(room, self, strict=True):
            new[:kept] = old
        used = _add(*room, kept, start, way, error)
        return Means(*(values[:used] for values in room))

    def check(self) -> None:
        """Check that these may be the means of some errors.

        Raises:
            ValueRuleError: they are not.
        """
        if not ((self.number >= 1.0) & (self.number <= _LARGEST)).all():
            raise ValueRuleError("local_errors.number", None, f"it must be in [1, {_LARGEST:g}]")
        if not (self.square * (1.0 + _ROUNDING) >= (self.error**2).sum(axis=-1)).all():
            raise ValueRuleError("local_errors.square", None, "a mean square is at least that of the mean")


class KeptForecasts(NamedTuple):
    """Forecasts from one instant that have not been compared yet.

    Attributes:
        due_s: when the last step can be compared.
        time_s: of each step. [P]
        person: whose. [N]
        start: x, world frame, m. [N, 2]
        point: before it was shifted, world frame, m. [N, P, 2]
    """

    due_s: float
    time_s: np.ndarray
    person: np.ndarray
    start: np.ndarray
    point: np.ndarray


class Waiting(NamedTuple):
    """Errors of people who are still there.

    Attributes:
        person: whose. [W]
        time_s: when they were compared, s. [W]
        start: x, world frame, m. [W, 2]
        way: d, m. [W, 2]
        error: at each step, m. [W, P, 2]
    """

    person: np.ndarray
    time_s: np.ndarray
    start: np.ndarray
    way: np.ndarray
    error: np.ndarray

    @classmethod
    def empty(cls, steps: int) -> Waiting:
        """Before the first comparison."""
        none = np.zeros((0, 2))
        return cls(np.zeros(0, np.int64), np.zeros(0), none, none, np.zeros((0, steps, 2)))

    def concatenated(self, new: Waiting) -> Waiting:
        """These errors, then `new`."""
        return Waiting(*(np.concatenate(both) for both in zip(self, new, strict=True)))

    def select(self, rows: np.ndarray | slice) -> Waiting:
        """Some of them."""
        return Waiting(*(values[rows] for values in self))


@dataclass(frozen=True)
class LocalErrors:
    """What was learned at a place, and the forecasts to learn from.

    Attributes:
        means: of the errors of people who have left.
        waiting: errors of the others.
        past: forecasts to compare.
    """

    means: Means
    waiting: Waiting
    past: tuple[KeptForecasts, ...] = ()

    @classmethod
    def initial(cls, steps: int) -> LocalErrors:
        """Before the first instant: forecasts stay as they are."""
        return cls(Means.empty(steps), Waiting.empty(steps))

    def without_people(self) -> LocalErrors:
        """What was learned, with nobody to learn from."""
        return LocalErrors(self.means.with_errors(*self.waiting[2:]), self.waiting.select(slice(0)))

    def plain(self) -> dict[str, Any]:
        """What was learned, as lists of numbers."""
        return {name: values.tolist() for name, values in self.without_people().means._asdict().items()}

    def restored(self, plain: Mapping[str, Any]) -> LocalErrors:
        """With nobody there, and with what another one had learned, see `plain`.

        Raises:
            ValueRuleError: a value breaks its rule.
        """
        rows = len(finite("local_errors.number", plain["number"], (None,)))
        if rows > _MOST:
            raise ValueRuleError("local_errors.number", rows, f"there are at most {_MOST}")
        steps = self.means.error.shape[1]
        empty = Means.empty(steps, rows)
        if not rows:
            return self.initial(steps)
        values = (finite(f"local_errors.{n}", plain[n], old.shape) for n, old in empty._asdict().items())
        means = Means(*values)
        means.check()
        return replace(self.initial(steps), means=means)

    def update(
        self, now: Instant, forecasts: Predictions, position: np.ndarray
    ) -> tuple[LocalErrors, Predictions]:
        """Learn from the detections of an instant, and shift the forecasts.

        Args:
            now: the instant.
            forecasts: world frame. [N]
            position: where people are, world frame, m. [N, 2]

        Returns:
            Everything afterwards, and the forecasts with other paths.
        """
        walks = groups_of(forecasts) == WALKING
        errors = self
        if now.is_look:
            errors = self._compare(now)._admit(now, forecasts.steps * forecasts.dt_s)
            errors = errors._keep(now, forecasts, position, walks)
        if not len(errors.means.number) and not len(errors.waiting.person):
            return errors, forecasts
        way = forecasts.point[:, -1] - position
        shift = errors.shifts(now.person, position, way) * walks[:, None, None]
        moved = replace(forecasts, point=forecasts.point + shift, path=forecasts.path + shift[:, None])
        return errors, moved

    def shifts(self, person: np.ndarray, start: np.ndarray, way: np.ndarray) -> np.ndarray:
        """What to add to forecasts, m. [N, P, 2].

        Args:
            person: whose. [N]
            start: x, world frame, m. [N, 2]
            way: d, m. [N, 2]
        """
        shift, own = np.zeros((len(start), *self.means.error.shape[1:])), self.waiting
        order = np.argsort(own.person, kind="stable")
        begin, end = (own.person.searchsorted(person, side, order) for side in ("left", "right"))
        _write_shifts(shift, *self.means[:-1], *own[2:], order, begin, end, start, way)
        return shift

    def _compare(self, now: Instant) -> LocalErrors:
        """After the comparison of the forecasts that are due with the detections."""
        now_s, waiting = now.time_s + TIME_TOLERANCE_S, self.waiting
        due = [past for past in self.past if past.due_s <= now_s]
        if not due:
            return self
        for one in due:
            error = now.detections.paths(one.person, one.time_s) - one.point
            when_s = np.full(len(one.person), now.time_s)
            new = Waiting(one.person, when_s, one.start, one.point[:, -1] - one.start, error)
            waiting = waiting.concatenated(new.select(~np.isnan(error).any(axis=(1, 2))))
        past = tuple(one for one in self.past if one.due_s > now_s)
        return replace(self, waiting=waiting, past=past)

    def _admit(self, now: Instant, horizon_s: float) -> LocalErrors:
        """With the errors of people who have left among the others."""
        waiting = self.waiting
        lately = now.detections.people_since(now.time_s - horizon_s - LEFT_AFTER_S)
        gone = ~is_in_sorted(lately, waiting.person)
        stays = ~gone & (waiting.time_s > now.time_s - _WAIT_S)
        if stays.all():
            return self
        means = self.means.with_errors(*waiting.select(gone)[2:]) if gone.any() else self.means
        return replace(self, means=means, waiting=waiting.select(stays))

    def _keep(
        self, now: Instant, forecasts: Predictions, position: np.ndarray, walks: np.ndarray
    ) -> LocalErrors:
        """With the forecasts of people [N] who walk, are detected and known, to be compared."""
        first, end = now.detections.rows_of(now.person)
        rows = np.flatnonzero(walks & now.seen & (end - first >= KNOWN))
        if not len(rows):
            return self
        step_s = now.time_s + forecasts.dt_s * np.arange(1, forecasts.steps + 1)
        start, point = position[rows].copy(), forecasts.point[rows].astype(np.float64)
        kept = KeptForecasts(step_s[-1] + NEAR_S, step_s, now.person[rows], start, point)
        return replace(self, past=(*self.past, kept))


@compiled
def _add(start, way, error, square, number, latest, used, new_start, new_way, new_error):  # pragma: no cover
    """Add errors to the means, of which the first `used` are there; return how many are then (compiled)."""
    comparison = latest[:used].max() if used else 0.0
    for n in range(len(new_start)):
        near, row = _SAME_M * _SAME_M, -1
        for m in range(used):
            apart = _apart(start[m], way[m], new_start[n], new_way[n])
            if apart < near:
                near, row = apart, m
        if row < 0:
            row = used if used < len(number) else int(np.argmin(latest))
            used = max(used, row + 1)
            number[row], start[row], way[row], error[row], square[row] = 0.0, 0.0, 0.0, 0.0, 0.0
        comparison += 1.0
        number[row], latest[row] = min(number[row] + 1.0, _LARGEST), comparison
        share = 1.0 / number[row]
        for axis in range(2):
            start[row, axis] += share * (new_start[n, axis] - start[row, axis])
            way[row, axis] += share * (new_way[n, axis] - way[row, axis])
        for p in range(error.shape[1]):
            x, y = new_error[n, p]
            error[row, p, 0] += share * (x - error[row, p, 0])
            error[row, p, 1] += share * (y - error[row, p, 1])
            square[row, p] += share * (x * x + y * y - square[row, p])
    return used


@compiled
def _write_shifts(  # pragma: no cover (compiled)
    shift, start, way, error, square, number, own_start, own_way, own_error, order, begin, end, at, going
):
    """Write the shift of each person, whose own errors are rows order[begin:end]; see the equations above."""
    steps = error.shape[1]
    squares = np.empty(steps)
    for n in range(len(at)):
        mean, total, of_squares = shift[n], 0.0, 0.0
        squares[:] = 0.0
        for m in range(len(number)):
            near = _near(start[m], way[m], at[n], going[n])
            if near == 0.0:
                continue
            weight = near * number[m]
            total += weight
            of_squares += near * weight
            for p in range(steps):
                mean[p, 0] += weight * error[m, p, 0]
                mean[p, 1] += weight * error[m, p, 1]
                squares[p] += weight * square[m, p]
        for m in order[begin[n] : end[n]]:
            near = _near(own_start[m], own_way[m], at[n], going[n])
            if near == 0.0:
                continue
            total += near
            of_squares += _ALIKE_OWN / _ALIKE * near * near
            for p in range(steps):
                x, y = own_error[m, p]
                mean[p, 0] += near * x
                mean[p, 1] += near * y
                squares[p] += near * (x * x + y * y)
        if total == 0.0:
            continue
        for p in range(steps):
            x, y = mean[p, 0] / total, mean[p, 1] / total
            size = x * x + y * y
            variance = max(squares[p] / total - size, 0.0) + _LEAST_M2
            spread = variance * _ALIKE * of_squares / (total * total)
            share = total / (total + _PRIOR) * size / (size + spread)
            mean[p, 0], mean[p, 1] = share * x, share * y


@compiled
def _near(start, way, other_start, other_way):  # pragma: no cover (compiled)
    """Kernel of two forecasts: w_j for one error."""
    near = max(0.0, 1.0 - _apart(start, way, other_start, other_way) / (_REACH_M * _REACH_M))
    return near * near


@compiled
def _apart(start, way, other_start, other_way):  # pragma: no cover (compiled)
    """Squared distance of two forecasts in (x, d), m^2."""
    x, y = start[0] - other_start[0], start[1] - other_start[1]
    u, v = way[0] - other_way[0], way[1] - other_way[1]
    return x * x + y * y + u * u + v * v
