"""Comparison of earlier forecasts with detections: what each person adds to the a and b of `regions`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pedpred.forecasting.detections import NEAR_S, Detections
from pedpred.metrics.calibration import COARSE, REGIONS, share_inside
from pedpred.scenes import Predictions

_GAIN, _STEP = 0.075, 0.75
"""Per second: g of a person, and the most that the g of all sum to."""
_LATE = 0.8
"""Share of what was learned since a forecast was made that is applied before its comparison."""
_SHARES = np.array(REGIONS)[:, None]
_DEVIATION = np.sqrt(_SHARES * (1.0 - _SHARES))


@dataclass(frozen=True)
class Waiting:
    """Forecasts from one instant at one step whose time is still to come.

    Attributes:
        due_s: when it can be compared.
        step: index into the steps that are compared.
        forecast: numbers of the forecasts. [N]
        track_id: whose. [N]
        given: as published at the steps that are compared, world frame. [N]
        learned: a and b at that step and instant. [2]
    """

    due_s: float
    step: int
    forecast: np.ndarray
    track_id: np.ndarray
    given: Predictions
    learned: np.ndarray


@dataclass(frozen=True)
class Taught:
    """What forecasts of one instant added to a and b at one step; taken back if the person is lost.

    Attributes:
        until_s: when the last step is compared.
        step: see `Waiting`.
        forecast: see there. [N]
        by: added to a and b. [2, N]
    """

    until_s: float
    step: int
    forecast: np.ndarray
    by: np.ndarray

    def without(self, lost: np.ndarray) -> tuple[Taught, np.ndarray]:
        """Without some forecasts, and what those added. [2]."""
        gone = np.isin(self.forecast, lost)
        return replace(self, forecast=self.forecast[~gone], by=self.by[:, ~gone]), self.by[:, gone].sum(
            axis=1
        )


def comparison(
    due: Sequence[Waiting], known: Detections, learned: np.ndarray, noise_m: float, span_s: float
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Compare forecasts with detections.

    Args:
        due: at least one.
        known: where people were.
        learned: a and b now, of each step. [2, A]
        noise_m: see `Regions`.
        span_s: time that the comparisons stand for, s.

    Returns:
        Of each part of `due`: whose position is known, [N] bool, and what each adds to a and b, [2, N].
    """
    count = [len(own.forecast) for own in due]
    step, when_s = np.repeat([own.step for own in due], count), np.repeat([own.due_s for own in due], count)
    truth, noise = known.at(np.concatenate([own.track_id for own in due]), when_s - NEAR_S)
    seen, by = ~np.isnan(truth).any(axis=1), np.zeros((2, len(truth)))
    if seen.any():
        since = _LATE * np.repeat([learned[:, own.step] - own.learned for own in due], count, axis=0)[seen]
        given = _at_their_steps(due, seen)
        spread = given.covariance * factor(given.weight, *since.T[..., None, None])[..., None, None]
        spread += noise[seen, None, None, None, None] * noise_m**2 * np.eye(2)
        given = replace(given, covariance=spread)
        share = share_inside(given, truth[seen, None], COARSE)[:, 0]
        z50, z90, z95 = ((share > _SHARES) - (1.0 - _SHARES)) / _DEVIATION
        people = np.bincount(step[seen])[step[seen]]
        gain = span_s * np.minimum(_GAIN, _STEP / people)
        by[:, seen] = gain * np.stack([(z50 + z90 + z95) / 3.0, 0.5 * (0.5 * (z90 + z95) - z50)])
    ends = np.cumsum(count)[:-1]
    return np.split(seen, ends), np.split(by, ends, axis=1)


def _at_their_steps(due: Sequence[Waiting], seen: np.ndarray) -> Predictions:
    """The forecasts that are compared, each at its own step alone; some of them."""
    path, covariance = (
        np.concatenate([getattr(own.given, name)[:, :, own.step] for own in due])[seen, :, None]
        for name in ("path", "covariance")
    )
    weight = np.concatenate([own.given.weight for own in due])[seen]
    return Predictions(path[:, 0], path, weight, due[0].given.dt_s, covariance)


def at_steps(predictions: Predictions, rows: np.ndarray, steps: np.ndarray) -> Predictions:
    """Of some people, some steps alone."""
    assert predictions.covariance is not None
    point, path, covariance = predictions.point[rows], predictions.path[rows], predictions.covariance[rows]
    return replace(
        predictions,
        point=point[:, steps],
        path=path[:, :, steps],
        weight=predictions.weight[rows],
        covariance=covariance[:, :, steps],
    )


def widened(predictions: Predictions, wider: np.ndarray, tails: np.ndarray) -> Predictions:
    """With standard deviations times exp(a + b (2 t_k - 1)), see `regions`; a and b fit [W, K, P]."""
    assert predictions.covariance is not None
    wide = factor(predictions.weight, wider, tails)
    return replace(predictions, covariance=predictions.covariance * wide[..., None, None])


def factor(weight: np.ndarray, wider: np.ndarray, tails: np.ndarray) -> np.ndarray:
    """What covariances are multiplied by; see `widened`."""
    before = np.cumsum(weight, axis=1) - 0.5 * weight
    return np.exp(2.0 * (wider + tails * (2.0 * before[..., None] - 1.0)))
