"""Regions of probability that learn from how people walk at a place.

How far people stray from a forecast differs between places, crowds and sensors more than training can know.
So once a second everybody's forecast is kept, and compared with where the person was detected later. Of every
comparison, u is the share of the probability in the smallest region that reaches the person
(`pedpred.metrics.calibration.share_inside`). The regions of l = 50, 90 and 95 % should miss 1 - l of them:
    z_l = (1[u > l] - (1 - l)) / sqrt(l (1 - l))
    a += g (z_50 + z_90 + z_95) / 3,    b += g / 2 ((z_90 + z_95) / 2 - z_50)
at some steps of the horizon, and in between by interpolation (adaptive conformal inference, Gibbs & Candes
2021, with two parameters). The gain g is constant, because crowds change. Standard deviations of mode k are
multiplied by exp(a + b (2 t_k - 1)), with t_k the probability of the modes before it and half of its own: a
is for all, b for the tails. Paths, weights and the point forecast stay.

Every step is compared as soon as its time has come. Forecasts of people who are not seen up to the last step
do not count, as in the evaluation: what they taught is taken back then. Between a forecast and its comparison
others are compared; most of what was learned from them is applied to it before, or the same error would be
corrected again and again for 3 s. A detection has noise, which is no error of the forecast: its declared
variance is added to that of the forecast before they are compared.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pedpred.forecasting.detections import GAP_S, Detections
from pedpred.metrics.calibration import REGIONS, share_inside
from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_EVERY_S = 1.0
"""Time between two instants whose forecasts are kept, s: comparisons hardly repeat each other."""
_KNOWN = 3
"""Forecasts are kept of people who were detected so often lately."""
_COMPARED = 4
"""Steps of the horizon at which forecasts are compared, from the first to the last one."""
_GAIN, _STEP = 0.06, 0.6
"""g of one forecast, and the most that the gains of an instant's forecasts sum to."""
_LATE = 0.6
"""Share of what was learned since a forecast was made that is applied before its comparison."""
_WIDER, _TAILS = (-1.0, 1.0), (-0.3, 0.75)
"""Limits of a and b. A lower b would make sharp modes inside wide ones, which b is then lowered to mend."""
_SHARES = np.array(REGIONS)[:, None, None]
_DEVIATION = np.sqrt(_SHARES * (1.0 - _SHARES))


@dataclass(frozen=True)
class Kept:
    """Forecasts from one instant whose last step is still to come.

    Attributes:
        time_s: the instant.
        track_id: whose. [N]
        predictions: as published, world frame.
        wider: a at that instant. [A]
        tails: b. [A]
        taught: what each person added to a and b, at the steps compared so far. [2, N, 0 to A]
    """

    time_s: float
    track_id: np.ndarray
    predictions: Predictions
    wider: np.ndarray
    tails: np.ndarray
    taught: np.ndarray


@dataclass(frozen=True)
class Regions:
    """What was learned at a place, the forecasts to learn from, and the detections of their time.

    Attributes:
        steps: those at which forecasts are compared, rising. [A]
        wider: a, of each. [A]
        tails: b. [A]
        noise_m: standard deviation of a detection's coordinate, m; 0: detections are where people are.
        looked_s: when forecasts were last compared and kept, s.
        kept: by instant.
        detections: by instant.
    """

    steps: np.ndarray
    wider: np.ndarray
    tails: np.ndarray
    noise_m: float = 0.0
    looked_s: float = -np.inf
    kept: tuple[Kept, ...] = ()
    detections: tuple[Detections, ...] = ()

    @classmethod
    def unlearned(cls, steps: int, noise_m: float = 0.0) -> Regions:
        """Before the first instant: regions as the network gives them."""
        compared = np.unique(np.geomspace(1, steps, _COMPARED).round().astype(int)) - 1
        return cls(compared, np.zeros(len(compared)), np.zeros(len(compared)), noise_m)

    def without_people(self) -> Regions:
        """What was learned, with nobody to learn from."""
        return replace(self, looked_s=-np.inf, kept=(), detections=())

    def after(
        self,
        time_s: float,
        track_id: np.ndarray,
        detection: np.ndarray,
        seen: np.ndarray,
        given: Predictions,
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
        now = Detections(np.full(int(seen.sum()), time_s), track_id[seen], detection[seen])
        here = replace(self, detections=(*self.detections, now))
        if time_s < self.looked_s + _EVERY_S - TIME_TOLERANCE_S:
            return here, here.scaled(given)
        known = Detections.join(here.detections)
        here = here._compared(time_s, known)
        scaled = here.scaled(given)
        first, end = (np.searchsorted(known.track_id, track_id, side) for side in ("left", "right"))
        rows = np.flatnonzero(seen & (end - first >= _KNOWN))
        nothing = np.zeros((2, len(rows), 0))
        new = Kept(time_s, track_id[rows], scaled.select(rows), here.wider, here.tails, nothing)
        kept = (*here.kept, new)
        since_s = kept[0].time_s - GAP_S
        lately = tuple(part for part in here.detections if len(part.time_s) and part.time_s[0] >= since_s)
        return replace(here, looked_s=time_s, kept=kept, detections=lately), scaled

    def scaled(self, predictions: Predictions) -> Predictions:
        """Predictions whose regions are as learned so far."""
        if not (self.wider.any() or self.tails.any()):
            return predictions
        assert predictions.covariance is not None
        before = np.cumsum(predictions.weight, axis=1) - 0.5 * predictions.weight
        each = np.arange(predictions.steps)
        wider, tails = (np.interp(each, self.steps, values) for values in (self.wider, self.tails))
        factor = np.exp(2.0 * (wider + tails * (2.0 * before[..., None] - 1.0)))
        return replace(predictions, covariance=predictions.covariance * factor[..., None, None])

    def _compared(self, time_s: float, known: Detections) -> Regions:
        """After the comparison of kept forecasts with the detections, at the steps whose time has come."""
        learned, later = self, []
        for kept in self.kept:
            due = int((kept.time_s + self._ahead_s(kept) <= time_s + TIME_TOLERANCE_S).sum())
            learned, own = learned._taught(kept, due, known)
            if due < len(self.steps):
                later.append(own)
            else:
                learned = learned._without_lost(own, known)
        return replace(learned, kept=tuple(later))

    def _ahead_s(self, kept: Kept) -> np.ndarray:
        return kept.predictions.dt_s * (self.steps + 1)

    def _found(self, kept: Kept, known: Detections, some: slice) -> tuple[np.ndarray, np.ndarray]:
        """Where people were at some steps, NaN where nobody knows [N, S, 2], and the noise of that [N, S]."""
        due_s = np.tile(kept.time_s + self._ahead_s(kept)[some], len(kept.track_id))
        steps = len(self.steps[some])
        found, noise = known.at(np.repeat(kept.track_id, steps), due_s)
        return found.reshape(-1, steps, 2), noise.reshape(-1, steps)

    def _taught(self, kept: Kept, due: int, known: Detections) -> tuple[Regions, Kept]:
        """After the comparison of one instant's forecasts at those of the first `due` steps that are new."""
        new = slice(kept.taught.shape[2], due)
        if new.start == due:
            return self, kept
        found, noise = self._found(kept, known, new)
        rows = np.flatnonzero(~np.isnan(found).any(axis=(1, 2)))
        taught = np.zeros((2, *found.shape[:2]))
        if len(rows):
            shares = self._shares(kept, new, rows, found[rows], noise[rows])
            z50, z90, z95 = ((shares > _SHARES) - (1.0 - _SHARES)) / _DEVIATION
            gain = min(_GAIN, _STEP / len(rows))
            taught[:, rows] = gain * np.stack([(z50 + z90 + z95) / 3.0, 0.5 * (0.5 * (z90 + z95) - z50)])
        own = replace(kept, taught=np.concatenate([kept.taught, taught], axis=2))
        return self._moved(new, taught.sum(axis=1)), own

    def _shares(
        self, kept: Kept, new: slice, rows: np.ndarray, truth: np.ndarray, noise: np.ndarray
    ) -> np.ndarray:
        """Values of u of some people at some steps. [R, S]."""
        wider, tails = _LATE * (self.wider - kept.wider), _LATE * (self.tails - kept.tails)
        own = replace(self, wider=wider, tails=tails).scaled(kept.predictions.select(rows))
        assert own.covariance is not None
        steps, noise_m2 = self.steps[new], noise[:, None, :, None, None] * self.noise_m**2 * np.eye(2)
        path, covariance = own.path[:, :, steps], own.covariance[:, :, steps] + noise_m2
        return share_inside(replace(own, point=own.point[:, steps], path=path, covariance=covariance), truth)

    def _without_lost(self, kept: Kept, known: Detections) -> Regions:
        """Without what people taught who were not seen up to the last step."""
        every = slice(0, len(self.steps))
        lost = np.isnan(self._found(kept, known, every)[0]).any(axis=(1, 2))
        return self._moved(every, -kept.taught[:, lost].sum(axis=1))

    def _moved(self, some: slice, by: np.ndarray) -> Regions:
        """With a and b at some steps moved by something. [2, S]."""
        if not by.any():
            return self
        wider, tails = self.wider.copy(), self.tails.copy()
        wider[some] = np.clip(wider[some] + by[0], *_WIDER)
        tails[some] = np.clip(tails[some] + by[1], *_TAILS)
        return replace(self, wider=wider, tails=tails)


def learned(
    predictions: Predictions,
    track_id: np.ndarray,
    time_s: np.ndarray,
    detection: np.ndarray,
    seen: np.ndarray,
    noise_m: float = 0.0,
) -> Predictions:
    """Forecasts of many instants with regions that learn from one to the next; each from earlier ones only.

    Args:
        predictions: world frame. [W]
        track_id: of each row; rising in an instant. [W]
        time_s: the instants, never falling, s. [W]
        detection: see `Regions.after`. [W, 2]
        seen: see there. [W]
        noise_m: see `Regions`.
    """
    regions = Regions.unlearned(predictions.steps, noise_m)
    parts = [predictions.select(np.zeros(0, np.int64))]
    later = np.flatnonzero(np.diff(time_s) > TIME_TOLERANCE_S) + 1
    for begin, end in pairwise([0, *later.tolist(), len(predictions)]):
        now = np.arange(begin, end)
        own = predictions.select(now)
        regions, scaled = regions.after(float(time_s[begin]), track_id[now], detection[now], seen[now], own)
        parts.append(scaled)
    return Predictions.join(parts)
