"""How far to trust a network beside straight lines, learned from how people walk.

A network has seen many places, not this one. Where people walk straighter or detections are better than it
expects, a line through a person's last detections is the better forecast. So everybody's forecast is kept now
and then, beside such lines, and compared with where the person was detected later. Of every person, let n be
the network's point forecast at a step, d_l = line l - n, and e = position - n. The point forecast becomes
    n + sum_l w_l d_l,    w_l >= 0,    sum_l w_l <= 1
with the w that minimise
    sum |e - sum_l w_l d_l|^2 / (c + |e - sum_l v_l d_l|) + (M / N) sum_l w_l^2 sum |d_l|^2 / (c + |...|)
over the N forecasts of people who have left the place, and of the person itself, which count K times. v was
the place's w when they were compared: distances count, not their squares (iteratively reweighted least
squares). The second term draws w to 0, all trust in the network, as M forecasts would that were right. When N
is larger than some thousands, the sums fade. Each step of the horizon has a w for people who are forecast to
stand still, to stir and to walk each.

Every mode goes to the lines by the same w, so that the point forecast stays among the modes. A line that
misses the last detection, as that of somebody who has just turned, counts less or not at all, in both.

What somebody does changes no forecast of others before it has left.

Noise of the detection that ends a comparison is independent of d and changes no w in the mean. Forecasts of
people who are not seen up to the last step do not count, as in the evaluation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from pedpred.compiled import compiled
from pedpred.errors import ValueRuleError
from pedpred.forecasting.detections import (
    KNOWN,
    LEFT_AFTER_S,
    NEAR_S,
    Instant,
    Lines,
    is_in_sorted,
)
from pedpred.forecasting.groups import GROUPS, groups_of
from pedpred.scenes import Predictions
from pedpred.settings import finite
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_SPANS_S = np.array([2.4, 0.6])
"""Lines are fitted to so many seconds of detections, s: a steady one, and one that follows turns."""
_LINES = len(_SPANS_S)
_USED_S, _COMPARED_S = 1.2, 2.4
"""Lines are used, and compared, of people who have been followed for so long, s."""
_FITS_M = np.array([0.25, 0.5])
"""A line that misses the last detection by the first counts fully, by the second not at all, m."""
_PRIOR = np.array([20.0, 100.0, 100.0])
"""M of each group (`groups_of`)."""
_OWN, _MOST = 3.0, 10000.0
"""K, and the most forecasts that N counts: those of 100 people in half a minute."""
_ROUNDING = 1e-9
_NEAR_M = 0.02
"""c: errors below this, m, count as squares."""


class Sums(NamedTuple):
    """Sums over compared forecasts; for each of some people, or for none.

    Attributes:
        products: of d_l . d_m, weighted. [..., G, P, L, L]
        errors: of d_l . e, weighted. [..., G, P, L]
        compared: number of forecasts. [..., G]
    """

    products: np.ndarray
    errors: np.ndarray
    compared: np.ndarray

    @classmethod
    def empty(cls, steps: int, *people: int) -> Sums:
        """Before the first comparison, for so many people."""
        each = (*people, GROUPS)
        products, errors = np.zeros((*each, steps, _LINES, _LINES)), np.zeros((*each, steps, _LINES))
        return cls(products, errors, np.zeros(each))

    def with_comparisons(
        self, weights: np.ndarray, row: np.ndarray, group: np.ndarray, offset: np.ndarray, error: np.ndarray
    ) -> Sums:
        """The sums of some people after forecasts of these have been compared.

        Args:
            weights: w when these are compared. [G, P, L]
            row: who of them was forecast. [N]
            group: see `groups_of`. [N]
            offset: from the point forecast to the lines, m. [N, L, P, 2]
            error: from there to the position, m; forecasts of which a step is NaN do not count. [N, P, 2]
        """
        sums = Sums(*(values.copy() for values in self))
        _add(*sums, weights, row, group, offset, error)
        return sums.faded()

    def faded(self) -> Sums:
        """The same means, of at most `_MOST` forecasts."""
        fades = np.minimum(1.0, _MOST / np.maximum(self.compared, 1.0))
        return Sums(
            self.products * fades[..., None, None, None],
            self.errors * fades[..., None, None],
            self.compared * fades,
        )

    def best_weights(self, prior: np.ndarray = _PRIOR) -> np.ndarray:
        """The w that minimise the sum, with M of each group, or of each row of some sums. [..., P, L]."""
        prior = (prior / np.maximum(self.compared, 1.0))[..., None, None, None] * np.eye(_LINES)
        return best_weights(self.products * (1.0 + prior), self.errors)

    def check(self) -> None:
        """Check that these may be the sums of some forecasts.

        Raises:
            ValueRuleError: they are not.
        """
        squares = np.diagonal(self.products, axis1=-2, axis2=-1)
        both, other = self.products[..., 0, 1], self.products[..., 1, 0]
        equal, most = _ROUNDING * squares.sum(axis=-1), squares.prod(axis=-1) * (1.0 + _ROUNDING)
        if not ((squares >= 0).all() and (np.abs(both - other) <= equal).all() and (both**2 <= most).all()):
            raise ValueRuleError(
                "trust.products", None, "they must be symmetric, without negative eigenvalues"
            )
        if not ((self.compared >= 0).all() and (self.compared <= _MOST * (1.0 + _ROUNDING)).all()):
            raise ValueRuleError("trust.compared", self.compared.tolist(), f"it must be in [0, {_MOST:g}]")


class PastForecasts(NamedTuple):
    """Forecasts from one instant that have not been compared yet.

    Attributes:
        due_s: when the last step can be compared.
        time_s: of each step. [P]
        person: whose. [N]
        group: see `groups_of`. [N]
        point: of the network, world frame, m. [N, P, 2]
        offset: from there to the lines, m. [N, L, P, 2]
    """

    due_s: float
    time_s: np.ndarray
    person: np.ndarray
    group: np.ndarray
    point: np.ndarray
    offset: np.ndarray


@dataclass(frozen=True)
class Trust:
    """What was learned at a place, and the forecasts to learn from.

    Attributes:
        place: sums over the forecasts of people who have left.
        weights: w that follow from these alone. [G, P, L]
        person: whose forecasts have been compared and who is there, rising. [K]
        sums: over the forecasts of each. [K]
        past: forecasts to compare.
    """

    place: Sums
    weights: np.ndarray
    person: np.ndarray
    sums: Sums
    past: tuple[PastForecasts, ...] = ()

    @classmethod
    def initial(cls, steps: int) -> Trust:
        """Before the first instant: forecasts are the network's."""
        return cls.of_place(Sums.empty(steps))

    @classmethod
    def of_place(cls, place: Sums) -> Trust:
        """What a place has taught, with nobody there."""
        nobody = Sums.empty(place.errors.shape[-2], 0)
        return cls(place, place.best_weights(), np.zeros(0, np.int64), nobody)

    def without_people(self) -> Trust:
        """What was learned, with nobody to learn from."""
        return self.of_place(self._place_without(np.ones(len(self.person), bool)))

    def plain(self) -> dict[str, Any]:
        """What was learned of people who are there or have left, as lists of numbers."""
        return {name: values.tolist() for name, values in self.without_people().place._asdict().items()}

    def restored(self, plain: Mapping[str, Any]) -> Trust:
        """With nobody there, and with what another one had learned, see `plain`.

        Raises:
            ValueRuleError: a value breaks its rule.
        """
        place = Sums(
            *(finite(f"trust.{name}", plain[name], old.shape) for name, old in self.place._asdict().items())
        )
        place.check()
        return self.of_place(place)

    def update(self, now: Instant, forecasts: Predictions) -> tuple[Trust, Predictions]:
        """Learn from the detections of an instant, and move the forecasts to lines.

        Args:
            now: the instant.
            forecasts: of the network alone, world frame. [N]

        Returns:
            Everything afterwards, and the forecasts with other paths.
        """
        if not (now.is_look or self.weights.any() or len(self.person)):
            return self, forecasts
        lines = now.detections.lines(now.person, now.time_s, _SPANS_S)
        ahead_s = forecasts.dt_s * np.arange(1, forecasts.steps + 1)
        paths = lines.position[:, :, None] + lines.velocity[:, :, None] * ahead_s[:, None]
        offset, group = _zero_if_unknown(paths - forecasts.point[:, None]), groups_of(forecasts)
        fits = _zero_if_unknown(np.interp(lines.missed_m, _FITS_M, [1.0, 0.0]))
        trust = self
        if now.is_look:
            lately = now.detections.people_since(now.time_s - ahead_s[-1] - LEFT_AFTER_S)
            fitting = fits[:, :, None, None] * offset
            trust = self._compare(now)._admit(lately)
            trust = trust._keep(now, ahead_s, lines, group, forecasts.point, fitting)
        fits = fits * (lines.followed_s >= _USED_S - TIME_TOLERANCE_S)[:, None]
        weights = trust._weights_of(now.person, group) * fits[:, None]
        return trust, _move(forecasts, weights, offset) if weights.any() else forecasts

    def _weights_of(self, person: np.ndarray, group: np.ndarray) -> np.ndarray:
        """The w of some people [N] in their groups [N], from what place and person have taught. [N, P, L]."""
        weights, taught = self.weights[group], np.flatnonzero(is_in_sorted(self.person, person))
        if len(taught):
            row, of = self.person.searchsorted(person[taught]), group[taught]
            both = zip(self.place, self.sums, strict=True)
            sums = Sums(*(place[of] + _OWN * own[row, of] for place, own in both))
            weights[taught] = sums.best_weights(_PRIOR[of])
        return weights

    def _admit(self, lately: np.ndarray) -> Trust:
        """With what people have taught who are not among the latest [M], and so have left, in the place."""
        gone = ~is_in_sorted(lately, self.person)
        if not gone.any():
            return self
        place, sums = self._place_without(gone), Sums(*(values[~gone] for values in self.sums))
        return Trust(place, place.best_weights(), self.person[~gone], sums, self.past)

    def _place_without(self, gone: np.ndarray) -> Sums:
        """Sums of the place once some people [K] bool have left."""
        left = (values[gone].sum(axis=0) for values in self.sums)
        return Sums(*(both[0] + both[1] for both in zip(self.place, left, strict=True))).faded()

    def _compare(self, now: Instant) -> Trust:
        """After the comparison of the forecasts that are due with the detections."""
        now_s = now.time_s + TIME_TOLERANCE_S
        due = [past for past in self.past if past.due_s <= now_s]
        if not due:
            return self
        person = np.unique(np.concatenate([self.person, *(past.person for past in due)]))
        sums = Sums.empty(self.weights.shape[-2], len(person))
        for new, old in zip(sums, self.sums, strict=True):
            new[np.searchsorted(person, self.person)] = old
        for past in due:
            error = now.detections.paths(past.person, past.time_s) - past.point
            row = np.searchsorted(person, past.person)
            sums = sums.with_comparisons(self.weights, row, past.group, past.offset, error)
        later = tuple(past for past in self.past if past.due_s > now_s)
        return replace(self, person=person, sums=sums, past=later)

    def _keep(
        self,
        now: Instant,
        ahead_s: np.ndarray,
        lines: Lines,
        group: np.ndarray,
        point: np.ndarray,
        offset: np.ndarray,
    ) -> Trust:
        """With the forecasts of people who were followed for long enough, to be compared."""
        followed = lines.followed_s >= _COMPARED_S - TIME_TOLERANCE_S
        rows = np.flatnonzero(now.seen & followed & (lines.detections >= KNOWN))
        if not len(rows):
            return self
        step_s = now.time_s + ahead_s
        kept = now.person[rows], group[rows], point[rows].astype(np.float64), offset[rows]
        return replace(self, past=(*self.past, PastForecasts(step_s[-1] + NEAR_S, step_s, *kept)))


def _zero_if_unknown(values: np.ndarray) -> np.ndarray:
    """Values, 0 where they are NaN; `np.nan_to_num`, which looks for infinity, too, takes longer."""
    return np.where(np.isnan(values), 0.0, values)


def _move(predictions: Predictions, weights: np.ndarray, offset: np.ndarray) -> Predictions:
    """Predictions whose point and modes all go to the lines, by the same w.

    Args:
        predictions: of the network.
        weights: w of each. [N, P, L]
        offset: from the point forecast to the lines, m. [N, L, P, 2]
    """
    shift = (np.swapaxes(weights, 1, 2)[..., None] * offset).sum(axis=1)
    nearer = weights.sum(axis=-1)[:, None, :, None] * (predictions.point[:, None] - predictions.path)
    path = predictions.path + shift[:, None] + nearer
    return replace(predictions, point=predictions.point + shift, path=path)


@compiled
def _add(products, errors, compared, weights, row, group, offset, error):  # pragma: no cover (compiled)
    """Add to the sums in place; see `Sums.with_comparisons`."""
    people, lines, steps = offset.shape[:3]
    for n in range(people):
        if np.isnan(error[n]).any():
            continue
        k, g = row[n], group[n]
        compared[k, g] += 1.0
        for p in range(steps):
            x, y = error[n, p]
            left_x, left_y = x, y
            for line in range(lines):
                left_x -= weights[g, p, line] * offset[n, line, p, 0]
                left_y -= weights[g, p, line] * offset[n, line, p, 1]
            weight = 1.0 / (_NEAR_M + math.hypot(left_x, left_y))
            for line in range(lines):
                far_x, far_y = weight * offset[n, line, p, 0], weight * offset[n, line, p, 1]
                errors[k, g, p, line] += far_x * x + far_y * y
                for other in range(lines):
                    product = far_x * offset[n, other, p, 0] + far_y * offset[n, other, p, 1]
                    products[k, g, p, line, other] += product


def best_weights(products: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Minimise w A w / 2 - b w over w_1, w_2 >= 0 with w_1 + w_2 <= 1.

    Args:
        products: A, symmetric and without negative eigenvalues. [..., 2, 2]
        errors: b. [..., 2]

    Returns:
        w; 0 where A is 0. [..., 2]
    """
    weights = np.zeros(errors.shape)
    _minimise(products.reshape(-1, 2, 2), errors.reshape(-1, 2), weights.reshape(-1, 2))
    return weights


@compiled
def _minimise(products, errors, weights):  # pragma: no cover (compiled)
    """Write the best weights: those of the minimum, if it is in the triangle, or of the best edge."""
    for n in range(len(errors)):
        first, second, both = products[n, 0, 0], products[n, 1, 1], products[n, 0, 1]
        b, c, least = errors[n, 0], errors[n, 1], 0.0
        size, tilt = first * second - both * both, first + second - 2.0 * both
        share = min(max(_ratio(b - c + second - both, tilt), 0.0), 1.0)
        one, two = min(max(_ratio(b, first), 0.0), 1.0), min(max(_ratio(c, second), 0.0), 1.0)
        inside = _ratio(second * b - both * c, size), _ratio(first * c - both * b, size)
        for w, v in (inside, (one, 0.0), (0.0, two), (share, 1.0 - share)):
            loss = 0.5 * (first * w * w + second * v * v) + both * w * v - b * w - c * v
            if w >= 0.0 and v >= 0.0 and w + v <= 1.0 and loss < least:
                weights[n, 0], weights[n, 1], least = w, v, loss


@compiled
def _ratio(above, below):  # pragma: no cover (compiled)
    """Quotient; 0 where the divisor is not positive."""
    return above / below if below > 0.0 else 0.0
