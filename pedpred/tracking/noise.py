"""Noise of detections, learned while people walk: several filters per person, weighted by how they fit.

Detectors differ: motion capture and annotated splines are exact to millimetres, cameras to centimetres. A
filter that expects more noise than there is lags behind every turn, start and stop; one that expects less
takes noise for motion. So each person is followed by one filter per level of noise, whose states count by
their likelihood for this person so far (multiple-model estimation with a model that does not change: Magill
1965; Bar-Shalom, Li & Kirubarajan 2001, section 11.6.2). People are weighed one by one, so that nobody's
detections change another one's state. Nothing is learned of people who stand.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.tracking.kalman import Belief, KalmanSettings, correct, initial_belief, predict
from pedpred.tracking.spacing import SPACING_S

LEVELS = ((0.03, 0.10), (0.0152, 0.0335), (0.05, 0.02), (0.1, 0.006))
"""Spectral density of the acceleration, m^2/s^3, and deviation of a detection, m, beside those of a model."""

_GAIT_S = 0.1
"""A filter that lags less than this at a stream's rate follows the sway of every step; it is not used, s."""
_PRIOR = -2.0
"""Log weight of each level at the beginning; that of a model's own noise is 0."""
_LEAST = -10.0
"""Log weights fall no lower than this below the largest, so that a change of the noise is followed."""
_FARTHEST = 4.0
"""Misses of more standard deviations count as this many: they are no noise of a detector."""


@dataclass(frozen=True)
class KalmanBank:
    """Filters that run side by side.

    Attributes:
        filters: parameters of each; the first one counts most until the detections tell otherwise.
    """

    filters: tuple[KalmanSettings, ...]

    def __post_init__(self) -> None:
        if not self.filters:
            raise ValueRuleError("filters", self.filters, "there must be one at least")

    @classmethod
    def around(cls, tuned: KalmanSettings, learn_noise: bool = True) -> KalmanBank:
        """A model's own filter, and one for each level of noise that streams have if the noise is learned."""
        if not learn_noise:
            return cls((tuned,))
        levels = (KalmanSettings(q, r, tuned.initial_speed_mps) for q, r in LEVELS)
        return cls((tuned, *levels))

    @cached_property
    def acceleration_noise(self) -> np.ndarray:
        """Spectral density q of each filter, m^2/s^3. [H]."""
        return np.array([settings.acceleration_noise for settings in self.filters])

    @cached_property
    def position_noise_m(self) -> np.ndarray:
        """Standard deviation r of a detection for each filter, m. [H]."""
        return np.array([settings.position_noise_m for settings in self.filters])

    @cached_property
    def shortest_s(self) -> np.ndarray:
        """Detections closer in time than this make a filter lag less than `_GAIT_S`, s; 0: never. [H].

        The lag of a settled filter is about (r^2 dt / q)^(1/4).
        """
        least_s = _GAIT_S**4 * self.acceleration_noise / self.position_noise_m**2
        least_s[0] = 0.0
        return least_s

    def unlearned(self, people: int) -> np.ndarray:
        """Log weights of the filters of people who have just appeared. [N, H]."""
        weights = np.full((people, len(self.filters)), _PRIOR)
        weights[:, 0] = 0.0
        return weights

    def initial_beliefs(self, detection: np.ndarray) -> Belief:
        """Beliefs after first detections (m, [N, 2]), person by person, of each filter. N x H."""
        first = [
            vars(initial_belief(detection, one.position_noise_m, one.initial_speed_mps))
            for one in self.filters
        ]
        sizes = {name: values.shape[1] for name, values in first[0].items()}
        return Belief(
            *(
                np.stack([belief[name] for belief in first], axis=1).reshape(-1, size)
                for name, size in sizes.items()
            )
        )

    def follow(
        self,
        before: Belief,
        weights: np.ndarray,
        dt_s: np.ndarray,
        detection: np.ndarray,
        standstill_mps: float,
    ) -> tuple[Belief, np.ndarray]:
        """Beliefs and log weights after the next detections.

        Args:
            before: beliefs after the detections before, person by person, of each filter. N x H
            weights: log weights. [N, H]
            dt_s: time since those detections, s. [N]
            detection: m. [N, 2]
            standstill_mps: below this speed of the first filter somebody stands.
        """
        people, filters = weights.shape
        since_s = np.repeat(dt_s, filters)
        density, noise_m = (
            np.repeat(values[None], people, axis=0).ravel()  # a fifth of the time of `np.tile`
            for values in (self.acceleration_noise, self.position_noise_m)
        )
        ahead = predict(before, since_s, density)
        where = np.repeat(detection, filters, axis=0)
        after = correct(ahead, since_s, where, noise_m)
        if filters > 1:
            weights = weights + evidence(self, ahead, dt_s, detection, standstill_mps)
            weights = np.maximum(weights - weights.max(axis=1, keepdims=True), _LEAST)
        return after, weights


def weighted(beliefs: Belief, weights: np.ndarray) -> Belief:
    """Mean of each person's beliefs by their weights. [N].

    Args:
        beliefs: person by person, of each filter. N x H
        weights: log weights. [N, H]
    """
    people, filters = weights.shape
    if filters == 1:
        return beliefs
    share = np.exp(weights)
    share /= share.sum(axis=1, keepdims=True)
    parts = (part.reshape(people, filters, part.shape[1]) for part in vars(beliefs).values())
    return Belief(*((share[:, :, None] * part).sum(axis=1) for part in parts))


def evidence(
    bank: KalmanBank, ahead: Belief, dt_s: np.ndarray, detection: np.ndarray, standstill_mps: float
) -> np.ndarray:
    """Log density of the next detections under each filter; 0 for people who stand. [N, H].

    Of the innovation n with variance S per axis, log p = -log(2 pi S) - |n|^2 / (2 S). Detections that follow
    each other faster than `SPACING_S` count for the share of it that has passed. A filter that lags too
    little at this rate gets less than the first one.

    Args:
        bank: the filters.
        ahead: beliefs of `predict` at the detections, person by person, of each filter. N x H
        dt_s: time since the detection before, s. [N]
        detection: m. [N, 2]
        standstill_mps: below this speed of the first filter somebody stands.
    """
    people, filters = len(dt_s), len(bank.filters)
    position, velocity = (part.reshape(people, filters, 2) for part in (ahead.position, ahead.velocity))
    moves = np.hypot(velocity[:, 0, 0], velocity[:, 0, 1]) >= standstill_mps
    counted = (np.minimum(1.0, dt_s / SPACING_S) * moves)[:, None]
    variance = ahead.covariance[:, 0].reshape(people, filters) + bank.position_noise_m**2
    miss2 = ((detection[:, None] - position) ** 2).sum(axis=-1) / variance
    density = counted * (-np.log(2 * np.pi * variance) - np.minimum(miss2, _FARTHEST**2) / 2)
    hasty = np.maximum(dt_s, SPACING_S)[:, None] < bank.shortest_s
    return np.where(hasty, density[:, :1] - counted, density)
