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
its own: a is for all, b for the tails. People who are forecast to stand and to walk have an a and a b each.
Paths, weights and the point forecast stay.

Every step is compared as soon as the detections around its time are there. Forecasts of people who are not
seen up to the last step do not count, as in the evaluation: what they taught is taken back then. Most of what
was learned between a forecast and its comparison is applied to it before, or the same error would be
corrected again and again for up to 3 s. A detection has noise, which is no error of the forecast: its
declared variance is added to that of the forecast before they are compared. What is much smaller than the
noise cannot be told from it, so no standard deviation shrinks below a share of the noise. Detections in a
burst, which follow the last kept one within `pedpred.tracking.spacing.SPACING_S`, are left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.forecasting.comparisons import (
    EVERY_S,
    GROUPS,
    KNOWN,
    LATELY_S,
    Taught,
    Waiting,
    among,
    compare_with_detections,
    groups_of,
    widen_covariances,
)
from pedpred.forecasting.detections import NEAR_S, Detections
from pedpred.scenes import Predictions
from pedpred.settings import finite
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_LONG_S = 1.0
"""The longest time that an instant whose forecasts are kept stands for, s."""
_COMPARED = 4
"""Steps of the horizon at which forecasts are compared, from the first to the last one."""
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


@dataclass(frozen=True)
class Regions:
    """What was learned at a place, the forecasts to learn from, and the detections of their time.

    Attributes:
        steps: those at which forecasts are compared, rising. [A]
        learned: a and b, of each group (`groups_of`) and step. [2, G, A]
        noise_m: standard deviation of a detection's coordinate, m; 0: detections are where people are.
        on_lines: modes were moved to lines before.
        looked_s: when forecasts were last compared and kept, s.
        made: number of forecasts kept so far.
        waiting: for their time.
        taught: what may be taken back.
        detections: of the last seconds.
    """

    steps: np.ndarray
    learned: np.ndarray
    noise_m: float = 0.0
    on_lines: bool = False
    looked_s: float = -np.inf
    made: int = 0
    waiting: tuple[Waiting, ...] = ()
    taught: Taught = field(default_factory=Taught.nothing)
    detections: Detections = field(default_factory=Detections.none)

    @classmethod
    def unlearned(cls, steps: int, noise_m: float = 0.0, on_lines: bool = False) -> Regions:
        """Before the first instant: regions as the network gives them."""
        compared = np.unique(np.geomspace(1, steps, _COMPARED).round().astype(int)) - 1
        return cls(compared, np.zeros((2, GROUPS, len(compared))), noise_m, on_lines)

    @property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest a and b."""
        tails = _TAILS_ON_LINES if self.on_lines else _TAILS
        return np.array([_LEAST, tails])[:, None, None], _LARGEST

    def without_people(self) -> Regions:
        """What was learned, with nobody to learn from."""
        return replace(
            self, looked_s=-np.inf, waiting=(), taught=Taught.nothing(), detections=Detections.none()
        )

    def plain(self) -> dict[str, Any]:
        """What was learned, as lists of numbers."""
        return {"learned": self.learned.tolist()}

    def relearned(self, plain: Mapping[str, Any]) -> Regions:
        """Of an unlearned one: with what another one had learned, whatever its least b.

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

    def after(
        self,
        time_s: float,
        person: np.ndarray,
        detection: np.ndarray,
        seen: np.ndarray,
        forecasts: Predictions,
    ) -> tuple[Regions, Predictions]:
        """Take the detections of an instant and the forecasts from it.

        Args:
            time_s: the instant, later than all before, s.
            person: whole numbers that tell the people apart who are forecast, a new one for each life of an
                id. [N]
            detection: the last one of each, world frame, m. [N, 2]
            seen: who of them is detected at this instant, and not in a burst. [N] bool
            forecasts: their forecasts, world frame.

        Returns:
            Everything afterwards, and the forecasts with other covariances.
        """
        if forecasts.covariance is None:
            return self, forecasts
        known = self.detections.with_later(time_s, person[seen], detection[seen])
        if time_s < self.looked_s + EVERY_S - TIME_TOLERANCE_S:
            return replace(self, detections=known), self.scaled(forecasts)
        here = self._compared(time_s, known)
        scaled = here.scaled(forecasts)
        first, end = known.rows_of(person)
        rows = np.flatnonzero(seen & (end - first >= KNOWN))
        here = here._keeping(time_s, person[rows], rows, scaled)
        return replace(here, looked_s=time_s, detections=known.since(time_s - LATELY_S)), scaled

    def scaled(self, predictions: Predictions) -> Predictions:
        """Predictions whose regions are as learned so far."""
        if not self.learned.any():
            return predictions
        each, group = np.arange(predictions.steps), groups_of(predictions)
        wider, tails = np.array(
            [[np.interp(each, self.steps, parameter) for parameter in both] for both in self.learned]
        )
        return widen_covariances(predictions, wider[group], tails[group], _RESOLVED * self.noise_m)

    def _keeping(
        self, time_s: float, person: np.ndarray, rows: np.ndarray, forecasts: Predictions
    ) -> Regions:
        """With the forecasts of some people waiting for their time."""
        if not len(person):
            return self
        assert forecasts.covariance is not None
        forecast, group = self.made + np.arange(len(person)), groups_of(forecasts)[rows]
        due_s = (time_s + forecasts.dt_s * (self.steps + 1) + NEAR_S).tolist()
        weight = forecasts.weight[rows].astype(np.float64)
        path, covariance = (  # [A, N, K, ...]
            values[rows, :, self.steps[:, None]].astype(np.float64)
            for values in (forecasts.path, forecasts.covariance)
        )
        new = [
            Waiting(
                due_s[k], due_s[-1], k, forecast, person, group, path[k], covariance[k], weight,
                self.learned[:, :, k],
            )
            for k in range(len(self.steps))
        ]  # fmt: skip
        return replace(self, made=self.made + len(person), waiting=(*self.waiting, *new))

    def _compared(self, time_s: float, known: Detections) -> Regions:
        """After the comparison of the forecasts whose time has come with the detections."""
        now_s = time_s + TIME_TOLERANCE_S
        due = [past for past in self.waiting if past.due_s <= now_s]
        if not due:
            return self
        span_s = min(time_s - self.looked_s, _LONG_S)
        new, lost = compare_with_detections(due, known, self.learned, self.noise_m, span_s)
        moved, taught = new.sums(len(self.steps)), self.taught.joined(new)
        if len(lost):
            gone = among(np.sort(lost), taught.forecast)
            moved -= taught.select(gone).sums(len(self.steps))
            taught = taught.select(~gone)
        return replace(
            self,
            learned=np.clip(self.learned + moved, *self.limits),
            waiting=tuple(past for past in self.waiting if past.due_s > now_s),
            taught=taught.select(taught.until_s > now_s),
        )
