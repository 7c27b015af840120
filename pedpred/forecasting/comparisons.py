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

EVERY_S = 0.3
"""Least time between instants whose forecasts are kept, s."""
KNOWN, LATELY_S = 4, 4.0
"""Forecasts are kept of people who were detected so often, as in the evaluation, in so many seconds."""
_GAIN, _STEP = 0.075, 0.75
"""Per second: g of a person, and the most that the g of all sum to."""
_LATE = 0.8
"""Share of what was learned since a forecast was made that is applied before its comparison."""
_SHARES = np.array(REGIONS)
_Z = (np.tri(4, 3, -1) - (1.0 - _SHARES)) / np.sqrt(_SHARES * (1.0 - _SHARES))
"""z_50, z_90 and z_95 of somebody who is outside none, one, two or all of the regions."""
_TEACHES = np.stack([_Z.mean(axis=1), 0.5 * (0.5 * (_Z[:, 1] + _Z[:, 2]) - _Z[:, 0])])
"""What such a person adds to a and b per unit of gain. [2, 4]"""


GROUPS, _WALKING_MPS = 2, 0.3
"""People who are forecast to go slower than this, m/s, and the others have regions of their own."""


def groups_of(predictions: Predictions) -> np.ndarray:
    """0 for who is forecast to stand, 1 for who is forecast to walk, by the point forecast. [W] int64.

    Who stands strays less than who walks, and things that a detector takes for people never move.
    """
    way = predictions.point[:, -1] - predictions.point[:, 0]
    slow_m = _WALKING_MPS * (predictions.steps - 1) * predictions.dt_s
    return (np.hypot(way[:, 0], way[:, 1]) >= slow_m).astype(np.int64)


def among(rising: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Which values are some of rising ones; `np.isin` takes ten times as long for few."""
    return np.searchsorted(rising, values, "left") < np.searchsorted(rising, values, "right")


class Waiting(NamedTuple):
    """Forecasts from one instant at one step whose time is still to come.

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


class Taught(NamedTuple):
    """What forecasts added to a and b; taken back if the person is lost.

    Attributes:
        until_s: when the last step of the forecast is compared. [M]
        group: see `Waiting`. [M]
        step: see `Waiting`. [M]
        forecast: number of the forecast. [M]
        by: added to a and b. [2, M]
    """

    until_s: np.ndarray
    group: np.ndarray
    step: np.ndarray
    forecast: np.ndarray
    by: np.ndarray

    @classmethod
    def nothing(cls) -> Taught:
        """Before the first comparison."""
        none = np.zeros(0, np.int64)
        return cls(np.zeros(0), none, none, none, np.zeros((2, 0)))

    def joined(self, new: Taught) -> Taught:
        """Both."""
        return Taught(*(np.concatenate(both, axis=-1) for both in zip(self, new, strict=True)))

    def select(self, rows: np.ndarray) -> Taught:
        """Some of it (mask)."""
        return Taught(*(values[..., rows] for values in self))

    def sums(self, steps: int) -> np.ndarray:
        """Of each group and step. [2, G, A]."""
        cell = self.group * steps + self.step
        return (self.by @ (cell[:, None] == np.arange(GROUPS * steps))).reshape(2, GROUPS, steps)


def compare_with_detections(
    due: Sequence[Waiting], known: Detections, learned: np.ndarray, noise_m: float, span_s: float
) -> tuple[Taught, np.ndarray]:
    """Compare forecasts with detections.

    Args:
        due: at least one.
        known: where people were.
        learned: a and b now, of each group and step. [2, G, A]
        noise_m: see `Regions`.
        span_s: time that the comparisons stand for, s.

    Returns:
        What they teach, and the numbers of the forecasts of people of whom it is not known where they were.
    """
    count = np.array([len(past.forecast) for past in due])
    step, due_s, until_s = (
        np.repeat(values, count)
        for values in zip(*((past.step, past.due_s, past.until_s) for past in due), strict=True)
    )
    forecast, person, group = (
        np.concatenate(values)
        for values in zip(*((past.forecast, past.person, past.group) for past in due), strict=True)
    )
    truth, noise = known.at(person, due_s - NEAR_S)
    missed, variance, ends = np.empty(len(step), np.int64), noise * noise_m**2, np.cumsum(count)
    for past, begin, end in zip(due, ends - count, ends, strict=True):
        since = _LATE * (learned[:, :, past.step] - past.learned)
        there = past.path, past.covariance, past.weight, truth[begin:end], variance[begin:end]
        _count(missed[begin:end], *there, past.group, since, _SHARES, COARSE)
    seen = missed >= 0
    cell = group * learned.shape[2] + step
    people = np.bincount(cell[seen], minlength=learned[0].size)
    gain = span_s * np.minimum(_GAIN, _STEP / np.maximum(people, 1))
    taught = Taught(until_s, group, step, forecast, gain[cell] * _TEACHES[:, missed])
    return taught.select(seen), forecast[~seen]


@compiled
def _count(  # pragma: no cover (compiled)
    missed, path, covariance, weight, truth, variance, group, since, shares, points
):
    """Write how many regions do not hold the truth, -1 if that is not known; see `Waiting`. [N].

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
            describe(modes[mode], mean[0] - x, mean[1] - y, xx, xy, yy, share)
            before += share
        missed[row] = (share_reached(modes, points, shares) > shares).sum()


def widen_covariances(
    predictions: Predictions, wider: np.ndarray, tails: np.ndarray, least_m: float
) -> Predictions:
    """With standard deviations times exp(a + b (2 t_k - 1)), see `regions`; each row's a and b. [W, P].

    None becomes smaller than `least_m` by that; those which are smaller as they are, stay.
    """
    assert predictions.covariance is not None
    before = np.cumsum(predictions.weight, axis=1) - 0.5 * predictions.weight
    wide = np.exp(2.0 * (wider[:, None] + tails[:, None] * (2.0 * before[..., None] - 1.0)))
    if least_m:
        wide = np.maximum(wide, np.minimum(1.0, least_m**2 / _least_variance(predictions.covariance)))
    return replace(predictions, covariance=predictions.covariance * wide[..., None, None])


def _least_variance(covariance: np.ndarray) -> np.ndarray:
    """Along the short axis of each covariance. [..., 2, 2] -> [...]."""
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    return 0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy)
