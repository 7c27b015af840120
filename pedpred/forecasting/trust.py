"""How far to trust a network beside straight lines, learned from how people walk.

A network has seen many places, not this one. Where people walk straighter or detections are better than it
expects, a line through a person's last detections is the better forecast. So everybody's forecast is kept now
and then, beside such lines, and compared with where the person was detected later. Of every person, let n be
the network's point forecast at a step, d_l = line l - n, and e = position - n. The point forecast becomes
    n + sum_l w_l d_l,    w_l >= 0,    sum_l w_l <= 1
with the w that minimise
    sum |e - sum_l w_l d_l|^2 / (c + |e - sum_l v_l d_l|) + (M / N) sum_l w_l^2 sum |d_l|^2 / (c + |...|)
over the N forecasts of people who had left the place when this person came, where v was their w: distances
count, not their squares (iteratively reweighted least squares). The second term draws w to 0, all trust in
the network, as M forecasts would that were right. When N is larger than some thousands, the sums fade. Each
step of the horizon has a w, and people who are forecast to stand and to walk have their own. Every mode goes
to the lines by the same w, so that the point forecast stays among the modes. A line that misses the last
detection, as that of somebody who has just turned, counts less or not at all, in both.

What somebody does thus changes no forecast of anybody who is there at the same time.

Noise of the detection that ends a comparison is independent of d and changes no w in the mean. Forecasts of
people who are not seen up to the last step do not count, as in the evaluation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from pedpred.forecasting.comparisons import EVERY_S, KNOWN, among, groups_of
from pedpred.forecasting.detections import NEAR_S, Detections
from pedpred.forecasting.shares import Sums, check_sums
from pedpred.scenes import Predictions
from pedpred.settings import finite
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_SPANS_S = np.array([2.4, 0.6])
"""Lines are fitted to so many seconds of detections, s: a steady one, and one that follows turns."""
_USED_S, _COMPARED_S = 1.2, 2.4
"""Lines are used, and compared, of people who have been followed for so long, s."""
_FITS_M = np.array([0.25, 0.5])
"""A line that misses the last detection by the first counts fully, by the second not at all, m."""
_AFTER_S = 1.0
"""Who is not detected for longer than the horizon and this, s, has left."""


class Kept(NamedTuple):
    """Forecasts from one instant whose time is still to come.

    Attributes:
        due_s: when the last step can be compared.
        time_s: of each step. [P]
        person: whose. [N]
        group: see `groups_of`. [N]
        point: of the network, world frame, m. [N, P, 2]
        apart: from there to the lines, m. [N, L, P, 2]
    """

    due_s: float
    time_s: np.ndarray
    person: np.ndarray
    group: np.ndarray
    point: np.ndarray
    apart: np.ndarray


@dataclass(frozen=True)
class Trust:
    """What was learned at a place, the forecasts to learn from, and the detections of their time.

    Attributes:
        place: what those have taught who have left.
        person: who is there, rising. [K]
        taught: what each has taught so far. [K]
        weights: w for each, from when the person came. [K, G, P, L]
        looked_s: when forecasts were last compared and kept, s.
        waiting: for their time.
        detections: of the last seconds.
    """

    place: Sums
    person: np.ndarray
    taught: Sums
    weights: np.ndarray
    looked_s: float = -np.inf
    waiting: tuple[Kept, ...] = ()
    detections: Detections = field(default_factory=Detections.none)

    @classmethod
    def unlearned(cls, steps: int) -> Trust:
        """Before the first instant: forecasts are the network's."""
        return cls._of_place(Sums.nothing(steps))

    @classmethod
    def _of_place(cls, place: Sums) -> Trust:
        """With nobody there."""
        nobody = Sums.nothing(place.errors.shape[-2], 0)
        return cls(place, np.zeros(0, np.int64), nobody, nobody.errors)

    def without_people(self) -> Trust:
        """What was learned, with nobody to learn from."""
        return self._of_place(self._place_without(np.ones(len(self.person), bool)))

    def plain(self) -> dict[str, Any]:
        """What those have taught who are there or have left, as lists of numbers."""
        return {name: values.tolist() for name, values in self.without_people().place._asdict().items()}

    def relearned(self, plain: Mapping[str, Any]) -> Trust:
        """Of an unlearned one: with what another one had learned.

        Raises:
            ValueRuleError: a value breaks its rule.
        """
        place = Sums(
            *(finite(f"trust.{name}", plain[name], old.shape) for name, old in self.place._asdict().items())
        )
        check_sums(place)
        return self._of_place(place)

    def after(
        self,
        time_s: float,
        person: np.ndarray,
        detection: np.ndarray,
        seen: np.ndarray,
        forecasts: Predictions,
    ) -> tuple[Trust, Predictions]:
        """Take the detections of an instant and the forecasts from it.

        Args:
            time_s: see `Regions.after`.
            person: see there. [N]
            detection: see there. [N, 2]
            seen: see there. [N] bool
            forecasts: of the network alone, world frame.

        Returns:
            Everything afterwards, and the forecasts with other paths.
        """
        known = self.detections.with_later(time_s, person[seen], detection[seen])
        here = replace(self, detections=known)
        looks = time_s >= self.looked_s + EVERY_S - TIME_TOLERANCE_S
        if not looks and not here.weights.any():
            return here, forecasts
        lines = known.lines(person, time_s, _SPANS_S)
        ahead_s = forecasts.dt_s * np.arange(1, forecasts.steps + 1)
        if looks:
            late = known.since(time_s - ahead_s[-1] - _AFTER_S)
            used = lines.followed_s >= _USED_S - TIME_TOLERANCE_S
            here = replace(here._compared(time_s)._with_people(late, person[used]), detections=late)
        paths = lines.position[:, :, None] + lines.velocity[:, :, None] * ahead_s[:, None]
        apart, group = _zero_if_unknown(paths - forecasts.point[:, None]), groups_of(forecasts)
        fits = np.interp(_zero_if_unknown(lines.missed_m), _FITS_M, [1.0, 0.0])
        if looks:
            old = lines.followed_s >= _COMPARED_S - TIME_TOLERANCE_S
            rows = np.flatnonzero(seen & old & (lines.detections >= KNOWN))
            waiting, step_s = here.waiting, time_s + ahead_s
            if len(rows):
                point = forecasts.point[rows].astype(np.float64)
                fitting = fits[rows, :, None, None] * apart[rows]
                waiting += (Kept(step_s[-1] + NEAR_S, step_s, person[rows], group[rows], point, fitting),)
            here = replace(here, looked_s=time_s, waiting=waiting)
        shares = here._shares(person, group) * fits[:, None]
        return here, _moved(forecasts, shares, apart) if shares.any() else forecasts

    def _shares(self, person: np.ndarray, group: np.ndarray) -> np.ndarray:
        """The w of some people; 0 for who has just come. [N, P, L]."""
        there = np.flatnonzero(among(self.person, person))
        shares = np.zeros((len(person), *self.weights.shape[2:]))
        shares[there] = self.weights[np.searchsorted(self.person, person[there]), group[there]]
        return shares

    def _with_people(self, known: Detections, person: np.ndarray) -> Trust:
        """With some people [N], who may have come, and without those who are not detected any more."""
        gone = ~among(known.person, self.person)
        stays, come = np.flatnonzero(~gone), person[~among(self.person, person)]
        if len(stays) == len(gone) and not len(come):
            return self
        place = self._place_without(gone) if gone.any() else self.place
        everybody = np.concatenate([self.person[stays], come])
        order = np.argsort(everybody)

        def joined(old: np.ndarray, new: np.ndarray) -> np.ndarray:
            return np.concatenate([old[stays], np.broadcast_to(new, (len(come), *new.shape))])[order]

        return replace(
            self,
            place=place,
            person=everybody[order],
            taught=Sums(*map(joined, self.taught, Sums.nothing(self.weights.shape[-2]))),
            weights=joined(self.weights, place.best_weights()),
        )

    def _place_without(self, gone: np.ndarray) -> Sums:
        """What the place has taught once some people [K] bool have left."""
        left = (values[gone].sum(axis=0) for values in self.taught)
        return Sums(*(both[0] + both[1] for both in zip(self.place, left, strict=True))).faded()

    def _compared(self, time_s: float) -> Trust:
        """After the comparison of the forecasts whose time has come with the detections."""
        now_s = time_s + TIME_TOLERANCE_S
        due = [past for past in self.waiting if past.due_s <= now_s]
        if not due:
            return self
        taught = self.taught
        for past in due:
            steps, people = len(past.time_s), len(past.person)
            asked = np.repeat(past.person, steps), np.tile(past.time_s, people)
            error = self.detections.at(*asked)[0].reshape(past.point.shape) - past.point
            row = np.searchsorted(self.person, past.person)
            taught = taught.with_comparisons(self.weights, row, past.group, past.apart, error)
        waiting = tuple(past for past in self.waiting if past.due_s > now_s)
        return replace(self, taught=taught, waiting=waiting)


def _zero_if_unknown(values: np.ndarray) -> np.ndarray:
    """Values, 0 where they are NaN; `np.nan_to_num`, which looks for infinity, too, takes longer."""
    return np.where(np.isnan(values), 0.0, values)


def _moved(predictions: Predictions, shares: np.ndarray, apart: np.ndarray) -> Predictions:
    """Predictions whose point and modes all go to the lines, by the same shares.

    Args:
        predictions: of the network.
        shares: w of each. [N, P, L]
        apart: from the point forecast to the lines, m. [N, L, P, 2]
    """
    shift = (np.swapaxes(shares, 1, 2)[..., None] * apart).sum(axis=1)
    nearer = shares.sum(axis=-1)[:, None, :, None] * (predictions.point[:, None] - predictions.path)
    path = predictions.path + shift[:, None] + nearer
    return replace(predictions, point=predictions.point + shift, path=path)
