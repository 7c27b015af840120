"""Comparison of earlier forecasts with detections: what each person adds to the a and b of `regions`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pedpred.compiled import compiled
from pedpred.forecasting.detections import NEAR_S, Detections
from pedpred.metrics.calibration import COARSE, REGIONS, describe, share_reached
from pedpred.scenes import Predictions

_GAIN, _STEP = 0.075, 0.75
"""Per second: g of a person, and the most that the g of all sum to."""
_LATE = 0.8
"""Share of what was learned since a forecast was made that is applied before its comparison."""
_SHARES = np.array(REGIONS)
_Z = (np.tri(4, 3, -1) - (1.0 - _SHARES)) / np.sqrt(_SHARES * (1.0 - _SHARES))
"""z_50, z_90 and z_95 of somebody who is outside none, one, two or all of the regions."""
_TEACHES = np.stack([_Z.mean(axis=1), 0.5 * (0.5 * (_Z[:, 1] + _Z[:, 2]) - _Z[:, 0])])
"""What such a person adds to a and b per unit of gain. [2, 4]"""


class Waiting(NamedTuple):
    """Forecasts from one instant at one step whose time is still to come.

    Attributes:
        due_s: when it can be compared.
        until_s: when the last step can be compared.
        step: index into the steps that are compared.
        forecast: numbers of the forecasts. [N]
        track_id: whose. [N]
        path: as published at the step, world frame, m. [N, K, 2]
        covariance: of it. [N, K, 2, 2]
        weight: of the modes. [N, K]
        learned: a and b at that step and instant. [2]
    """

    due_s: float
    until_s: float
    step: int
    forecast: np.ndarray
    track_id: np.ndarray
    path: np.ndarray
    covariance: np.ndarray
    weight: np.ndarray
    learned: np.ndarray


class Taught(NamedTuple):
    """What forecasts added to a and b; taken back if the person is lost.

    Attributes:
        until_s: when the last step of the forecast is compared. [M]
        step: see `Waiting`. [M]
        forecast: number of the forecast. [M]
        by: added to a and b. [2, M]
    """

    until_s: np.ndarray
    step: np.ndarray
    forecast: np.ndarray
    by: np.ndarray

    @classmethod
    def nothing(cls) -> Taught:
        """Before the first comparison."""
        return cls(np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((2, 0)))

    def joined(self, new: Taught) -> Taught:
        """Both."""
        return Taught(*(np.concatenate(both, axis=-1) for both in zip(self, new, strict=True)))

    def select(self, rows: np.ndarray) -> Taught:
        """Some of it (mask)."""
        return Taught(*(values[..., rows] for values in self))

    def sums(self, steps: int) -> np.ndarray:
        """Of each step. [2, A]."""
        return self.by @ (self.step[:, None] == np.arange(steps))


def comparison(
    due: Sequence[Waiting], known: Detections, learned: np.ndarray, noise_m: float, span_s: float
) -> tuple[Taught, np.ndarray]:
    """Compare forecasts with detections.

    Args:
        due: at least one.
        known: where people were.
        learned: a and b now, of each step. [2, A]
        noise_m: see `Regions`.
        span_s: time that the comparisons stand for, s.

    Returns:
        What they teach, and the numbers of the forecasts of people of whom it is not known where they were.
    """
    count = np.array([len(own.forecast) for own in due])
    step, due_s, until_s = (
        np.repeat(values, count)
        for values in zip(*((own.step, own.due_s, own.until_s) for own in due), strict=True)
    )
    forecast, track_id = (
        np.concatenate(values) for values in zip(*((own.forecast, own.track_id) for own in due), strict=True)
    )
    truth, noise = known.at(track_id, due_s - NEAR_S)
    missed, variance, ends = np.empty(len(step), np.int64), noise * noise_m**2, np.cumsum(count)
    for own, begin, end in zip(due, ends - count, ends, strict=True):
        since = _LATE * (learned[:, own.step] - own.learned)
        there = own.path, own.covariance, own.weight, truth[begin:end], variance[begin:end], since
        _count(missed[begin:end], *there, _SHARES, COARSE)
    seen = missed >= 0
    people = np.bincount(step[seen], minlength=learned.shape[1])
    gain = span_s * np.minimum(_GAIN, _STEP / np.maximum(people, 1))
    taught = Taught(until_s, step, forecast, gain[step] * _TEACHES[:, missed])
    return taught.select(seen), forecast[~seen]


@compiled
def _count(missed, path, covariance, weight, truth, variance, since, shares, points):  # pragma: no cover
    """Write how many regions do not hold the truth, -1 if that is not known; see `Waiting`. [N]."""
    modes = np.empty((path.shape[1], 9))
    for row in range(len(path)):
        (x, y), noise, before = truth[row], variance[row], 0.0
        missed[row] = -1
        if np.isnan(x + y):
            continue
        for mode in range(len(modes)):
            own, mean, sigma = weight[row, mode], path[row, mode], covariance[row, mode]
            wide = math.exp(2.0 * (since[0] + since[1] * (2.0 * before + own - 1.0)))
            xx, xy, yy = wide * sigma[0, 0] + noise, wide * sigma[1, 0], wide * sigma[1, 1] + noise
            describe(modes[mode], mean[0] - x, mean[1] - y, xx, xy, yy, own)
            before += own
        missed[row] = (share_reached(modes, points, shares) > shares).sum()


def widened(predictions: Predictions, wider: np.ndarray, tails: np.ndarray) -> Predictions:
    """With standard deviations times exp(a + b (2 t_k - 1)), see `regions`; a and b of each step. [P]."""
    assert predictions.covariance is not None
    before = np.cumsum(predictions.weight, axis=1) - 0.5 * predictions.weight
    wide = np.exp(2.0 * (wider + tails * (2.0 * before[..., None] - 1.0)))
    return replace(predictions, covariance=predictions.covariance * wide[..., None, None])
