"""Regions of probability that learn from how people walk at a place.

How far people stray from a forecast differs between places, crowds and sensors more than training can know.
So some forecasts are kept until their time has come and compared with where the person is then detected. Of
every comparison, u is the share of the probability in the smallest region that reaches the person
(`pedpred.metrics.calibration.share_inside`). The regions of l = 50, 90 and 95 % should miss 1 - l of them:
    z_l = (1[u > l] - (1 - l)) / sqrt(l (1 - l))
    a += g (z_50 + z_90 + z_95) / 3,    b += g ((z_90 + z_95) / 2 - z_50)
at some steps of the horizon, and in between by interpolation (adaptive conformal inference, Gibbs & Candes
2021, with two parameters). Forecasts of people who are not seen up to the last step do not count, as in the
evaluation. The gain g falls with the number of those that do. Standard deviations of mode k are multiplied by
exp(a + b (2 t_k - 1)), with t_k the probability of the modes before it and half of its own: a is for all, b
for the tails. Paths, weights and the point forecast stay.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pedpred.metrics.calibration import REGIONS, share_inside
from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_KNOWN = 3
"""Forecasts are kept of people with so many detections."""
_EVERY_S = 1.0
"""Nobody's forecast is kept more often, so that comparisons hardly repeat each other."""
_AT_ONCE = 48
"""Forecasts that are kept of one instant, at most: those of people who waited the longest."""
_GAP_S = 1.0
"""Positions are known between detections that are at most so far apart, s."""
_FIRST, _LEAST = 0.05, 0.003
"""The first and the least gain g of a comparison."""
_STEP, _LARGEST = 0.3, 1.0
"""Limits of the change at an instant, and of a and b."""
_COMPARED = 4
"""Steps of the horizon at which forecasts are compared, from the first to the last one."""
_SHARES = np.array(REGIONS)
_DEVIATION = np.sqrt(_SHARES * (1.0 - _SHARES))


@dataclass(frozen=True)
class _Known:
    """People who were detected lately, by track.

    Attributes:
        track_id: rising. [N] int64
        detections: without a gap. [N]
        seen_s: time of the last one, s. [N]
        position: then, as detected, world frame, m. [N, 2]
        kept_s: instant of the last forecast that was kept, or of the first detection, s. [N]
    """

    track_id: np.ndarray
    detections: np.ndarray
    seen_s: np.ndarray
    position: np.ndarray
    kept_s: np.ndarray

    def rows_of(self, track_id: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows of some tracks, and which of these are known; the rows of others mean nothing."""
        at = np.minimum(np.searchsorted(self.track_id, track_id), max(len(self.track_id) - 1, 0))
        return at, self.track_id[at] == track_id if len(self.track_id) else np.zeros(len(track_id), bool)

    def after(self, time_s: float, track_id: np.ndarray, position: np.ndarray) -> _Known:
        """With the detections of an instant, by track; people not seen for `_GAP_S` are forgotten."""
        at, known = self.rows_of(track_id)
        known[known] = time_s - self.seen_s[at[known]] <= _GAP_S + TIME_TOLERANCE_S
        detections, kept_s = np.ones(len(at), np.int64), np.full(len(at), time_s)
        detections[known] += self.detections[at[known]]
        kept_s[known] = self.kept_s[at[known]]
        away = (time_s - self.seen_s <= _GAP_S) & ~np.isin(self.track_id, track_id)
        mine = (track_id, detections, np.full(len(at), time_s), position, kept_s)
        order = np.argsort(np.concatenate([track_id, self.track_id[away]]))
        parts = zip(mine, vars(self).values(), strict=True)
        return _Known(*(np.concatenate([now, before[away]])[order] for now, before in parts))


@dataclass(frozen=True)
class Regions:
    """What was learned at a place, and the forecasts whose time has not come.

    Attributes:
        steps: those at which forecasts are compared, rising. [A]
        wider: a, of each. [A]
        tails: b. [A]
        learned: number of forecasts so far.
        known: people who were detected lately.
        kept: their forecasts, as given; None: none yet. [M]
        kept_of: tracks of these. [M]
        kept_s: their instants, s. [M]
        shares: u of each comparison; NaN where it was not made. [M, A]
    """

    steps: np.ndarray
    wider: np.ndarray
    tails: np.ndarray
    learned: int
    known: _Known
    kept: Predictions | None
    kept_of: np.ndarray
    kept_s: np.ndarray
    shares: np.ndarray

    @classmethod
    def unlearned(cls, steps: int) -> Regions:
        """Before the first instant: regions as the network gives them."""
        none, whole = np.zeros(0), np.zeros(0, np.int64)
        nobody = _Known(whole, whole, none, np.zeros((0, 2)), none)
        compared = np.unique(np.geomspace(1, steps, _COMPARED).round().astype(int)) - 1
        zero, shares = np.zeros(len(compared)), np.zeros((0, len(compared)))
        return cls(compared, zero, zero, 0, nobody, None, whole, none, shares)

    def without_people(self) -> Regions:
        """What was learned, with nobody known."""
        nobody = self.unlearned(int(self.steps[-1]) + 1)
        return replace(nobody, wider=self.wider, tails=self.tails, learned=self.learned)

    def after(
        self, time_s: float, track_id: np.ndarray, detection: np.ndarray, seen: np.ndarray, given: Predictions
    ) -> tuple[Regions, Predictions]:
        """Take the detections of an instant and the forecasts from it.

        Args:
            time_s: the instant, later than all before, s.
            track_id: of the people who are forecast, rising. [N]
            detection: the last one of each, world frame, m. [N, 2]
            seen: who of them is detected at this instant. [N] bool
            given: their forecasts, world frame.

        Returns:
            Everything afterwards, and the forecasts with other covariances.
        """
        if given.covariance is None:
            return self, given
        track_id, detection = track_id[seen], detection[seen]
        learned = self._compared(time_s, track_id, detection)
        learned = replace(learned, known=self.known.after(time_s, track_id, detection))
        scaled = learned.scaled(given)
        return learned._keeping(time_s, track_id, scaled.select(seen)), scaled

    def scaled(self, predictions: Predictions) -> Predictions:
        """Predictions whose regions are as learned so far."""
        assert predictions.covariance is not None
        before = np.cumsum(predictions.weight, axis=1) - 0.5 * predictions.weight
        each = np.arange(predictions.steps)
        wider, tails = (np.interp(each, self.steps, values) for values in (self.wider, self.tails))
        factor = np.exp(2.0 * (wider + tails * (2.0 * before[..., None] - 1.0)))
        return replace(predictions, covariance=predictions.covariance * factor[..., None, None])

    def _compared(self, time_s: float, track_id: np.ndarray, detection: np.ndarray) -> Regions:
        """After the comparison of kept forecasts with the detections of an instant. [D] and [D, 2]."""
        if self.kept is None or not len(self.kept) or not len(track_id):
            return self
        before, known = self.known.rows_of(self.kept_of)
        now = np.minimum(np.searchsorted(track_id, self.kept_of), len(track_id) - 1)
        seen_s = self.known.seen_s[before]
        known &= (track_id[now] == self.kept_of) & (time_s - seen_s <= _GAP_S + TIME_TOLERANCE_S)
        due_s = self.kept_s[:, None] + self.kept.dt_s * (self.steps + 1)
        due = known[:, None] & (due_s > seen_s[:, None] + TIME_TOLERANCE_S)
        row, step = np.nonzero(due & (due_s <= time_s + TIME_TOLERANCE_S))
        if not len(row):
            return self
        start, end = self.known.position[before[row]], detection[now[row]]
        part = (due_s[row, step] - seen_s[row]) / (time_s - seen_s[row])
        truth, shares = start + part[:, None] * (end - start), self.shares.copy()
        shares[row, step] = share_inside(_one_step(self.kept, row, self.steps[step]), truth[:, None])[:, 0]
        over = np.isin(np.arange(len(due)), row[step == len(self.steps) - 1])
        return replace(self, shares=shares)._learned(shares[over & ~np.isnan(shares).any(axis=1)])

    def _learned(self, shares: np.ndarray) -> Regions:
        """After some forecasts with all their comparisons. [C, A]."""
        if not len(shares):
            return self
        missed = ((shares > _SHARES[:, None, None]) - (1.0 - _SHARES)[:, None, None]).sum(axis=1)
        z50, z90, z95 = missed / _DEVIATION[:, None]
        gain = max(1.0 / (1.0 / _FIRST + self.learned), _LEAST)
        gain = min(gain, _STEP / len(shares))
        return replace(
            self,
            wider=np.clip(self.wider + gain * (z50 + z90 + z95) / 3.0, -_LARGEST, _LARGEST),
            tails=np.clip(self.tails + gain * (0.5 * (z90 + z95) - z50), -_LARGEST, _LARGEST),
            learned=self.learned + len(shares),
        )

    def _keeping(self, time_s: float, track_id: np.ndarray, given: Predictions) -> Regions:
        """Keep some forecasts of people who are detected now [D], and no longer those whose time is over."""
        at, _ = self.known.rows_of(track_id)
        waited_s = time_s - self.known.kept_s[at]
        ready = (self.known.detections[at] >= _KNOWN) & (waited_s >= _EVERY_S - TIME_TOLERANCE_S)
        rows = np.flatnonzero(ready)
        rows = np.sort(rows[np.argsort(-waited_s[rows], kind="stable")[:_AT_ONCE]])
        still = self.kept_s + given.dt_s * given.steps > time_s + TIME_TOLERANCE_S - _GAP_S
        still &= np.isnan(self.shares[:, -1])
        if not len(rows) and still.all():
            return self
        kept_s, new = self.known.kept_s.copy(), given.select(rows)
        kept_s[at[rows]] = time_s
        return replace(
            self,
            known=replace(self.known, kept_s=kept_s),
            kept=new if self.kept is None else Predictions.join([self.kept.select(still), new]),
            kept_of=np.concatenate([self.kept_of[still], track_id[rows]]),
            kept_s=np.concatenate([self.kept_s[still], np.full(len(rows), time_s)]),
            shares=np.concatenate([self.shares[still], np.full((len(rows), len(self.steps)), np.nan)]),
        )


def _one_step(predictions: Predictions, row: np.ndarray, step: np.ndarray) -> Predictions:
    """Predictions of single steps [C] of some rows [C]."""
    assert predictions.covariance is not None
    return replace(
        predictions,
        point=predictions.point[row, step][:, None],
        path=predictions.path[row, :, step][:, :, None],
        weight=predictions.weight[row],
        covariance=predictions.covariance[row, :, step][:, :, None],
    )


def learned(
    predictions: Predictions,
    track_id: np.ndarray,
    time_s: np.ndarray,
    detection: np.ndarray,
    seen: np.ndarray,
) -> Predictions:
    """Forecasts of many instants with regions that learn from one to the next; each from earlier ones only.

    Args:
        predictions: world frame. [W]
        track_id: of each row; rising in an instant. [W]
        time_s: the instants, never falling, s. [W]
        detection: see `Regions.after`. [W, 2]
        seen: see there. [W]
    """
    regions, parts = Regions.unlearned(predictions.steps), [predictions.select(np.zeros(0, np.int64))]
    later = np.flatnonzero(np.diff(time_s) > TIME_TOLERANCE_S) + 1
    for begin, end in pairwise([0, *later.tolist(), len(predictions)]):
        now = np.arange(begin, end)
        own = predictions.select(now)
        regions, scaled = regions.after(float(time_s[begin]), track_id[now], detection[now], seen[now], own)
        parts.append(scaled)
    return Predictions.join(parts)
