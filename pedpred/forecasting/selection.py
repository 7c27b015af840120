"""Joint choice of modes: people who are forecast together do not walk through each other.

A network forecasts everybody alone. Here everybody chooses a mode that keeps away from the likely modes of
the others at every step, in a few rounds in which all people move at once (a damped mean field, see Koller &
Friedman 2009, ch. 11.5):
    q_i(k) ~ exp(SHARP (ln w_i(k) - YIELD L_i(k))),    L_i(k) = sum_jl q_j(l) max(0, 1 - d_ik,jl / NEAR_M)
with d the least distance of mode k of person i and mode l of person j at any step. The order of people plays
no part, and nobody is influenced from farther away than `ROUNDS` times `REACH_M`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numba import njit
from scipy.special import softmax

from pedpred.errors import ShapeError, ValueRuleError
from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S

NEAR_M = 0.3
"""Paths that come nearer than this at the same step avoid each other, m."""
REACH_M = 7.0
"""People farther apart than this at present do not regard each other, m; less so over the last `_FADE_M`."""
ROUNDS = 3
_FADE_M = 2.0
_YIELD = 6.0  # of the choice, nats for paths that meet
_DAMPING = 0.5
_SHARP = 4.0
_LEAST = 1e-12  # weight
_DIGITS = 4


def consistent(predictions: Predictions, position: np.ndarray, time_s: np.ndarray) -> Predictions:
    """Choose the modes of everybody at an instant together.

    The chosen mode comes first: modes that were more likely share their weight with it evenly. Other weights
    stay, so that the likelihood of what people really do hardly changes.

    Args:
        predictions: of everybody present at some instants, world frame. [W]
        position: where each person is, world frame, m. [W, 2]
        time_s: the instant of each row; rows of one instant regard each other, s. [W]

    Returns:
        The same paths with other weights; predictions of a single mode are returned as they are.
    """
    if predictions.frame != "world":
        raise ValueRuleError("frame", predictions.frame, "people choose together in the world frame")
    if position.shape != (len(predictions), 2):
        raise ShapeError("position", position.shape, f"({len(predictions)}, 2)")
    if predictions.modes == 1:
        return predictions
    weight, chosen = predictions.weight.copy(), np.zeros(len(predictions), np.int64)
    for rows in _instants(time_s):
        first, second, closeness = _conflicts(predictions.path[rows], position[rows])
        if len(first):
            weight[rows], chosen[rows] = _chosen(weight[rows], first, second, closeness)
    other = np.arange(predictions.modes) != chosen[:, None]
    order = np.lexsort((other, -weight), axis=1)
    at = np.arange(len(weight))[:, None], order
    covariance = predictions.covariance
    return replace(
        predictions,
        path=predictions.path[at],
        weight=weight[at],
        covariance=None if covariance is None else covariance[at],
    )


def _instants(time_s: np.ndarray) -> Iterator[np.ndarray]:
    """Rows of each instant with several people."""
    order = np.argsort(time_s, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(time_s[order]) > TIME_TOLERANCE_S) + 1):
        if len(rows) > 1:
            yield rows


def _chosen(
    weight: np.ndarray, first: np.ndarray, second: np.ndarray, closeness: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """New weights of one instant's people, and the mode chosen for each. [N, K], [N].

    Args:
        weight: before. [N, K]
        first: of each conflict, the index of a mode among all N * K. [C]
        second: of the other person's mode. [C]
        closeness: 0 to 1. [C]
    """
    alone = np.log(np.maximum(weight, _LEAST))
    load = np.zeros(weight.size)
    for _ in range(ROUNDS):
        likely = softmax(_SHARP * (alone - _YIELD * load.reshape(weight.shape)), axis=1).ravel()
        new = np.bincount(first, closeness * likely[second], weight.size)
        new += np.bincount(second, closeness * likely[first], weight.size)
        load += _DAMPING * (new - load)
    loads = load.reshape(weight.shape)
    chosen = np.argmax(np.round(alone - _YIELD * loads, _DIGITS), axis=1)  # equal modes: the first one
    above = weight >= np.take_along_axis(weight, chosen[:, None], axis=1)
    share = (weight * above).sum(axis=1) / above.sum(axis=1)
    return np.where(above, share[:, None], weight), chosen


def _conflicts(path: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find modes of different people that come near each other at the same step.

    Args:
        path: of the modes of one instant's people, world frame, m. [N, K, P, 2]
        position: where they are, m. [N, 2]

    Returns:
        Indices of both modes among all N * K, and their closeness: 1 where they meet, 0 at `NEAR_M`. [C] each
    """
    people, modes, steps = path.shape[:3]
    points = path.reshape(people * modes, steps, 2).transpose(1, 0, 2)
    order = np.argsort(points[..., 0], axis=1)
    x, y = (np.take_along_axis(points[..., axis], order, axis=1) for axis in range(2))
    owner = order // modes
    found = _near_points(x, y, owner, NEAR_M, _near_points(x, y, owner, NEAR_M, -1)[1])[0]
    step, one, other = found.T
    pair = np.sort([order[step, one], order[step, other]], axis=0)
    square = (x[step, one] - x[step, other]) ** 2 + (y[step, one] - y[step, other]) ** 2
    key = pair[0] * people * modes + pair[1]
    sequence = np.argsort(key)
    begins = np.flatnonzero(np.diff(key[sequence], prepend=-1))
    first, second = pair[:, sequence[begins]]
    square = np.minimum.reduceat(square[sequence], begins) if len(begins) else square  # of all steps
    away = np.linalg.norm(position[first // modes] - position[second // modes], axis=-1)
    regard = np.clip((REACH_M - away) / _FADE_M, 0.0, 1.0)
    met = regard > 0
    return first[met], second[met], (regard * (1.0 - np.sqrt(square) / NEAR_M))[met]


@njit(cache=True, nogil=True)
def _near_points(
    x: np.ndarray, y: np.ndarray, owner: np.ndarray, near_m: float, count: int
) -> tuple[np.ndarray, int]:  # pragma: no cover (compiled)
    """Find pairs of points of different owners that are near each other, in a sweep along x.

    Args:
        x: points of each step, rising in a row, m. [P, M]
        y: m. [P, M]
        owner: of each point. [P, M]
        near_m: how near, m.
        count: number of pairs C; -1 only counts them.

    Returns:
        Step, and column of both points. [C, 3]; and their number.
    """
    pairs = np.empty((max(count, 0), 3), np.int64)
    found = 0
    for p in range(x.shape[0]):
        for i in range(x.shape[1]):
            for j in range(i + 1, x.shape[1]):
                dx, dy = x[p, j] - x[p, i], y[p, j] - y[p, i]
                if dx >= near_m:
                    break
                if dx * dx + dy * dy < near_m * near_m and owner[p, i] != owner[p, j]:
                    if count >= 0:
                        pairs[found, 0], pairs[found, 1], pairs[found, 2] = p, i, j
                    found += 1
    return pairs, found
