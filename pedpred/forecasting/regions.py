"""Regions of probability that learn from how people walk at a place.

How far people stray from a forecast differs between places, crowds and sensors more than training can know.
So everybody's forecast is kept now and then, and compared with where the person was detected later. Of every
comparison, u is the share of the probability in the smallest region that reaches the person
(`pedpred.metrics.calibration.share_inside`). The regions of l = 50, 90 and 95 % should miss 1 - l of them:
    z_l = (1[u > l] - (1 - l)) / sqrt(l (1 - l))
    a += g (z_50 + z_90 + z_95) / 3,    b += g / 2 ((z_90 + z_95) / 2 - z_50)
at some steps of the horizon, and in between by interpolation (adaptive conformal inference, Gibbs & Candes
2021, with two parameters). The gain g per second is constant, because crowds change. Standard deviations of
mode k are multiplied by exp(a + b (2 t_k - 1)), with t_k the probability of the modes before it and half of
its own: a is for all, b for the tails. People who are forecast to stand still, to stir and to walk have an a
and a b each (`pedpred.forecasting.groups`). Modes of a faster group than their person are never narrowed:
those who stand still stray by millimetres, and who walks off is none of them. Paths, weights and the point
forecast stay.

A forecast is in three places, one after the other: each of its compared steps is a `PendingForecast` until
the detections around its time are there; its comparison becomes an `Adjustment` of a and b; that is undone,
and later steps do not count, if it is not known where the person is at one of the steps, as such forecasts
do not count in the evaluation either. Most of what was learned between a forecast and its comparison is
applied to it before, or the same error would be corrected again and again for up to 3 s. A detection has
noise, which is no error of the forecast: its declared variance is added to that of the forecast before they
are compared. What is much smaller than the noise cannot be told from it, so no standard deviation shrinks
below a share of the noise. Detections in a burst, which follow the last kept one within
`pedpred.tracking.spacing.SPACING_S`, are left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from pedpred.compiled import compiled
from pedpred.errors import ValueRuleError
from pedpred.forecasting.detections import KNOWN, NEAR_S, Detections, Instant, is_in_sorted
from pedpred.forecasting.groups import GROUPS, groups_of, is_faster_mode
from pedpred.metrics.calibration import COARSE, REGIONS, share_reached, write_component
from pedpred.scenes import Predictions
from pedpred.settings import finite
from pedpred.tracking.tracks import TIME_TOLERANCE_S

LATELY_S = 4.0
"""Detections of so many seconds tell of whom forecasts are kept, s; see `KNOWN`."""
_LONG_S = 1.0
"""The longest time that an instant whose forecasts are kept stands for, s."""
_COMPARED = 4
"""Steps of the horizon at which forecasts are compared, from the first to the last one."""
_GAIN, _STEP = 0.075, 0.75
"""Per second: g of a person, and the most that the g of all sum to."""
_LATE = 0.8
"""Share of what was learned since a forecast was made that is applied before its comparison."""
_SHARES = np.array(REGIONS)
_Z = (np.tri(4, 3, -1) - (1.0 - _SHARES)) / np.sqrt(_SHARES * (1.0 - _SHARES))
"""z_50, z_90 and z_95 of somebody who is outside none, one, two or all of the regions."""
_ADJUSTS = np.stack([_Z.mean(axis=1), 0.5 * (0.5 * (_Z[:, 1] + _Z[:, 2]) - _Z[:, 0])])
"""What such a person adds to a and b per unit of gain. [2, 4]"""
_TAILS, _TAILS_ON_LINES = -0.3, -0.45
"""Least b. A lower one would make sharp modes inside wide ones, which b is then lowered to mend. Modes that
were moved to lines (`pedpred.forecasting.trust`) are nearer to each other, and the lines' noise is that of
the sharp modes, too."""
_LEAST, _LARGEST = -3.0, np.array([1.0, 2.0])[:, None, None]
"""Least a, and largest a and b. Where positions are exact, people who stand stray by less than 1 mm in the
first step: a is -2.9."""
_RESOLVED = 0.25
"""Least standard deviation that is learned, as a share of the declared noise: about what a tracker's position
has at 50 Hz. Beside the noise, regions of people who stand look alike with any smaller one."""


class PendingForecast(NamedTuple):
    """Forecasts from one instant at one step that have not been compared yet.

    Attributes:
        due_s: when it can be compared.
        until_s: when the last step can be compared.
        step: index into the steps that are compared.
        forecast: numbers of the forecasts. [N]
        person: whose. [N]
        group: which regions they have (`groups_of`). [N]
        path: as published at the step, world frame, m. [N, K, 2]
        covariance: of it. [N, K, 2, 2]
        weight: of the modes. [N, K]
        learned: a and b of each group at that step and instant. [2, G]
    """

    due_s: float
    until_s: float
    step: int
    forecast: np.ndarray
    person: np.ndarray
    group: np.ndarray
    path: np.ndarray
    covariance: np.ndarray
    weight: np.ndarray
    learned: np.ndarray


class Adjustment(NamedTuple):
    """What compared forecasts added to a and b; undone if the person is lost before the last step.

    Attributes:
        until_s: when the last step of the forecast is compared. [M]
        group: see `PendingForecast`. [M]
        step: see `PendingForecast`. [M]
        forecast: number of the forecast. [M]
        by: added to a and b. [2, M]
    """

    until_s: np.ndarray
    group: np.ndarray
    step: np.ndarray
    forecast: np.ndarray
    by: np.ndarray

    @classmethod
    def empty(cls) -> Adjustment:
        """Before the first comparison."""
        none = np.zeros(0, np.int64)
        return cls(np.zeros(0), none, none, none, np.zeros((2, 0)))

    def concatenated(self, new: Adjustment) -> Adjustment:
        """These adjustments, then `new`."""
        return Adjustment(*(np.concatenate(both, axis=-1) for both in zip(self, new, strict=True)))

    def select(self, rows: np.ndarray) -> Adjustment:
        """Some of them (mask)."""
        return Adjustment(*(values[..., rows] for values in self))

    def sums(self, steps: int) -> np.ndarray:
        """Sum of `by` over the forecasts of each group and step. [2, G, A]."""
        cell = self.group * steps + self.step
        return (self.by @ (cell[:, None] == np.arange(GROUPS * steps))).reshape(2, GROUPS, steps)


@dataclass(frozen=True)
class Regions:
    """What was learned at a place, and the forecasts to learn from.

    Attributes:
        steps: those at which forecasts are compared, rising. [A]
        between: share of each of them at every step of the horizon. [A, P]
        learned: a and b, of each group (`groups_of`) and step. [2, G, A]
        noise_m: standard deviation of a detection's coordinate, m; 0: detections are where people are.
        on_lines: modes were moved to lines before.
        made: number of forecasts kept so far.
        pending: forecasts to compare.
        lost: numbers of those whose people were lost, rising; they are compared no more.
        adjustment: what may be undone.
    """

    steps: np.ndarray
    between: np.ndarray
    learned: np.ndarray
    noise_m: float = 0.0
    on_lines: bool = False
    made: int = 0
    pending: tuple[PendingForecast, ...] = ()
    lost: np.ndarray = field(default_factory=partial(np.zeros, 0, np.int64))
    adjustment: Adjustment = field(default_factory=Adjustment.empty)

    @classmethod
    def initial(cls, steps: int, noise_m: float = 0.0, on_lines: bool = False) -> Regions:
        """Before the first instant: regions as the network gives them."""
        compared = np.unique(np.geomspace(1, steps, _COMPARED).round().astype(int)) - 1
        each = np.arange(steps)
        between = np.stack([np.interp(each, compared, alone) for alone in np.eye(len(compared))])
        return cls(compared, between, np.zeros((2, GROUPS, len(compared))), noise_m, on_lines)

    @property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest a and b."""
        tails = _TAILS_ON_LINES if self.on_lines else _TAILS
        return np.array([_LEAST, tails])[:, None, None], _LARGEST

    def without_people(self) -> Regions:
        """What was learned, with nobody to learn from."""
        return replace(self, pending=(), lost=self.lost[:0], adjustment=Adjustment.empty())

    def plain(self) -> dict[str, Any]:
        """What was learned, as lists of numbers."""
        return {"learned": self.learned.tolist()}

    def restored(self, plain: Mapping[str, Any]) -> Regions:
        """With what another one had learned, see `plain`, whatever its least b.

        Raises:
            ValueRuleError: a value breaks its rule.
        """
        learned = finite("regions.learned", plain["learned"], self.learned.shape)
        low, high = replace(self, on_lines=True).limits  # the wider ones
        if not ((learned >= low) & (learned <= high)).all():
            bounds = zip("ab", low.ravel(), high.ravel(), strict=True)
            rule = ", ".join(f"{name} must be in [{least:g}, {most:g}]" for name, least, most in bounds)
            raise ValueRuleError("regions.learned", None, rule)
        return replace(self, learned=np.clip(learned, *self.limits))

    def update(self, now: Instant, forecasts: Predictions) -> tuple[Regions, Predictions]:
        """Learn from the detections of an instant, and scale the regions of the forecasts.

        Args:
            now: the instant.
            forecasts: world frame; returned as they are without covariances. [N]

        Returns:
            Everything afterwards, and the forecasts with other covariances.
        """
        if forecasts.covariance is None:
            return self, forecasts
        if not now.is_look:
            return self, self.scaled(forecasts)
        regions = self._compare(now)
        scaled = regions.scaled(forecasts)
        first, end = now.detections.since(now.looked_s - LATELY_S).rows_of(now.person)
        rows = np.flatnonzero(now.seen & (end - first >= KNOWN))
        return regions._keep(now, rows, scaled), scaled

    def scaled(self, predictions: Predictions) -> Predictions:
        """Predictions whose regions are as learned so far."""
        if not self.learned.any():
            return predictions
        group, (wider, tails) = groups_of(predictions), self.learned @ self.between
        return widen_covariances(predictions, wider[group], tails[group], _RESOLVED * self.noise_m)

    def _keep(self, now: Instant, rows: np.ndarray, forecasts: Predictions) -> Regions:
        """With the forecasts of some people, to be compared."""
        if not len(rows):
            return self
        assert forecasts.covariance is not None
        forecast, person, group = (
            self.made + np.arange(len(rows)),
            now.person[rows],
            groups_of(forecasts)[rows],
        )
        due_s = (now.time_s + forecasts.dt_s * (self.steps + 1) + NEAR_S).tolist()
        weight = forecasts.weight[rows].astype(np.float64)
        path, covariance = (  # [A, N, K, ...]
            values[rows, :, self.steps[:, None]].astype(np.float64)
            for values in (forecasts.path, forecasts.covariance)
        )
        new = [
            PendingForecast(
                due_s[k], due_s[-1], k, forecast, person, group, path[k], covariance[k], weight,
                self.learned[:, :, k],
            )
            for k in range(len(self.steps))
        ]  # fmt: skip
        return replace(self, made=self.made + len(rows), pending=(*self.pending, *new))

    def _compare(self, now: Instant) -> Regions:
        """After the comparison of the forecasts that are due with the detections."""
        now_s = now.time_s + TIME_TOLERANCE_S
        due = [one for one in self.pending if one.due_s <= now_s]
        if not due:
            return self
        span_s = min(now.time_s - now.looked_s, _LONG_S)
        new, gone = compare_with_detections(
            due, self.lost, now.detections, self.learned, self.noise_m, span_s
        )
        lost = np.sort(np.concatenate([self.lost, gone]))
        moved, adjustment = new.sums(len(self.steps)), self.adjustment.concatenated(new)
        pending = tuple(one for one in self.pending if one.due_s > now_s)
        if len(gone):
            undone = is_in_sorted(lost, adjustment.forecast)
            moved -= adjustment.select(undone).sums(len(self.steps))
            adjustment = adjustment.select(~undone)
        return replace(
            self,
            learned=np.clip(self.learned + moved, *self.limits),
            pending=pending,
            lost=lost[lost >= min((one.forecast[0] for one in pending), default=self.made)],
            adjustment=adjustment.select(adjustment.until_s > now_s),
        )


def compare_with_detections(
    due: Sequence[PendingForecast],
    lost: np.ndarray,
    known: Detections,
    learned: np.ndarray,
    noise_m: float,
    span_s: float,
) -> tuple[Adjustment, np.ndarray]:
    """Compare forecasts with detections.

    Args:
        due: at least one.
        lost: numbers of forecasts that do not count, rising.
        known: where people were.
        learned: a and b now, of each group and step. [2, G, A]
        noise_m: see `Regions`.
        span_s: time that the comparisons stand for, s.

    Returns:
        What they add to a and b, and the numbers of the other forecasts of people of whom it is not known
        where they were.
    """
    count = np.array([len(one.forecast) for one in due])
    step, due_s, until_s = (
        np.repeat(values, count)
        for values in zip(*((one.step, one.due_s, one.until_s) for one in due), strict=True)
    )
    forecast, person, group = (
        np.concatenate(values)
        for values in zip(*((one.forecast, one.person, one.group) for one in due), strict=True)
    )
    truth, noise = known.at(person, due_s - NEAR_S)
    missed, variance, ends = np.empty(len(step), np.int64), noise * noise_m**2, np.cumsum(count)
    for one, begin, end in zip(due, ends - count, ends, strict=True):
        since = _LATE * (learned[:, :, one.step] - one.learned)
        there = one.path, one.covariance, one.weight, truth[begin:end], variance[begin:end]
        _missed_regions(missed[begin:end], *there, one.group, since, _SHARES, COARSE)
    counts, located = ~is_in_sorted(lost, forecast), missed >= 0
    seen = counts & located
    cell = group * learned.shape[2] + step
    people = np.bincount(cell[seen], minlength=learned[0].size)
    gain = span_s * np.minimum(_GAIN, _STEP / np.maximum(people, 1))
    adjustment = Adjustment(until_s, group, step, forecast, gain[cell] * _ADJUSTS[:, missed])
    return adjustment.select(seen), forecast[counts & ~located]


@compiled
def _missed_regions(  # pragma: no cover (compiled)
    missed, path, covariance, weight, truth, variance, group, since, shares, points
):
    """Write how many regions do not hold the truth, -1 if that is not known; see `PendingForecast`. [N].

    `since` is what a and b of each group have learned since the forecasts. [2, G]
    """
    modes = np.empty((path.shape[1], 9))
    for row in range(len(path)):
        (x, y), (a, b), noise, before = truth[row], since[:, group[row]], variance[row], 0.0
        missed[row] = -1
        if np.isnan(x + y):
            continue
        for mode in range(len(modes)):
            share, mean, sigma = weight[row, mode], path[row, mode], covariance[row, mode]
            wide = math.exp(2.0 * (a + b * (2.0 * before + share - 1.0)))
            xx, xy, yy = wide * sigma[0, 0] + noise, wide * sigma[1, 0], wide * sigma[1, 1] + noise
            write_component(modes[mode], mean[0] - x, mean[1] - y, xx, xy, yy, share)
            before += share
        missed[row] = (share_reached(modes, points, shares) > shares).sum()


def widen_covariances(
    predictions: Predictions, wider: np.ndarray, tails: np.ndarray, least_m: float
) -> Predictions:
    """With standard deviations times exp(a + b (2 t_k - 1)); each row's a and b. [W, P].

    None becomes smaller than `least_m` by that, and none of a mode of a faster group (`is_faster_mode`)
    becomes smaller; those which are smaller as they are, stay.
    """
    assert predictions.covariance is not None
    before = np.cumsum(predictions.weight, axis=1) - 0.5 * predictions.weight
    wide = np.exp(2.0 * (wider[:, None] + tails[:, None] * (2.0 * before[..., None] - 1.0)))
    wide = np.where(is_faster_mode(predictions)[..., None], np.maximum(wide, 1.0), wide)
    if least_m:
        wide = np.maximum(wide, np.minimum(1.0, least_m**2 / _least_variance(predictions.covariance)))
    return replace(predictions, covariance=predictions.covariance * wide[..., None, None])


def _least_variance(covariance: np.ndarray) -> np.ndarray:
    """Along the short axis of each covariance. [..., 2, 2] -> [...]."""
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    return 0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy)
