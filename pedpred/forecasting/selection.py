"""Joint choice of modes: people who are forecast together do not walk through each other.

A network forecasts everybody alone. Here everybody chooses a mode that keeps away from the likely modes of
the others at every step, in a few rounds in which all people move at once (a damped mean field, see Koller &
Friedman 2009, ch. 11.5):
    q_i(k) ~ exp(SHARP (ln w_i(k) - YIELD L_i(k))),    L_i(k) = sum_jl q_j(l) max(0, 1 - d_ik,jl / NEAR_M)
with d the least distance of mode k of person i and mode l of person j at any step. The order of people plays
no part, and nobody is influenced from farther away than `ROUNDS` times `REACH_M`. In a crowd so dense that
each mode meets hundreds of others, people regard those nearer by only: time and memory stay bounded.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pedpred.compiled import compiled
from pedpred.errors import ValueRuleError, shape_error
from pedpred.scenes import Predictions

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
_ROOM = 8  # for so many conflicts of each mode at first
_MOST = 256  # conflicts of each mode; people 0.2 m apart have a third of that


def choose_modes(predictions: Predictions, position: np.ndarray) -> Predictions:
    """Choose the modes of everybody at an instant together.

    The chosen mode comes first: modes that were more likely share their weight with it evenly. Other weights
    stay, so that the likelihood of what people really do hardly changes.

    Args:
        predictions: of everybody present, world frame. [N]
        position: where each person is, world frame, m. [N, 2]

    Returns:
        The same paths with other weights; predictions of a single mode are returned as they are.
    """
    if predictions.frame != "world":
        raise ValueRuleError("frame", predictions.frame, "people choose together in the world frame")
    if position.shape != (len(predictions), 2):
        raise shape_error("position", position.shape, f"({len(predictions)}, 2)")
    if predictions.modes == 1:
        return predictions
    weight = predictions.weight.copy()
    order = np.empty(weight.shape, np.int64)
    order[:] = np.arange(predictions.modes)
    first, second, closeness = _conflicts(predictions.path, position)
    if len(first):
        _choose(first, second, closeness, np.log(np.maximum(weight, _LEAST)), weight, order)
    at = np.arange(len(weight))[:, None], order
    covariance = predictions.covariance
    return replace(
        predictions,
        path=predictions.path[at],
        weight=weight,
        covariance=None if covariance is None else covariance[at],
    )


@compiled
def _choose(first, second, closeness, alone, weight, order):  # pragma: no cover (compiled)
    """Write people's new weights and, the chosen one first, their modes.

    Args:
        first: of each conflict, the index of a mode among all N * K. [C]
        second: of the other person's mode. [C]
        closeness: 0 to 1. [C]
        alone: logarithms of their weights. [N, K]
        weight: of their modes, not rising; changed. [N, K]
        order: of their modes; changed. [N, K]
    """
    people, modes = alone.shape
    load, likely = np.zeros(people * modes), np.empty(people * modes)
    one, other = np.zeros(people * modes), np.zeros(people * modes)
    for _ in range(ROUNDS):
        for i in range(people):
            best, total = -np.inf, 0.0
            for k in range(modes):
                best = max(best, alone[i, k] - _YIELD * load[i * modes + k])
            for k in range(modes):
                at = i * modes + k
                likely[at] = math.exp(_SHARP * (alone[i, k] - _YIELD * load[at] - best))
                total += likely[at]
            for k in range(modes):
                likely[i * modes + k] /= total
        for c in range(len(first)):
            one[first[c]] += closeness[c] * likely[second[c]]
            other[second[c]] += closeness[c] * likely[first[c]]
        for at in range(people * modes):
            load[at] += _DAMPING * (one[at] + other[at] - load[at])
            one[at] = other[at] = 0.0
    for i in range(people):
        shares, chosen, best = weight[i], 0, -np.inf
        for k in range(modes):
            value = np.rint((alone[i, k] - _YIELD * load[i * modes + k]) * 10.0**_DIGITS)
            if value > best:  # of equal modes the first one
                chosen, best = k, value
        total, above, least = 0.0, 0, shares[chosen]
        while above < modes and shares[above] >= least:
            total, above = total + shares[above], above + 1
        shares[:above] = max(total / above, least)
        order[i, 0] = chosen
        for k in range(chosen):
            order[i, k + 1] = k


def _conflicts(path: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find modes of different people that come near each other at the same step.

    Args:
        path: of people's modes, world frame, m. [N, K, P, 2]
        position: where they are, m. [N, 2]

    Returns:
        Indices of both modes among all N * K, and their closeness: 1 where they meet, 0 at `NEAR_M`. At most
        `_MOST` of each mode: of more, those of people nearer by, and none where even those are more. [C] each
    """
    people, modes = path.shape[:2]
    low, high, least = path.min(axis=1), path.max(axis=1), np.empty((modes, modes))
    most, count, reach_m = _MOST * people * modes, _ROOM * people * modes, REACH_M
    while reach_m >= NEAR_M:
        pair, closeness = np.empty((2, count), np.int64), np.empty(count)
        total = _conflicting_pairs(path, low, high, position, reach_m, most, least, pair, closeness)
        if total <= count:
            return pair[0, :total], pair[1, :total], closeness[:total]
        count, reach_m = (total, reach_m) if total <= most else (count, 0.25 * reach_m)
    none = np.zeros(0, np.int64)
    return none, none, np.zeros(0)


@compiled
def _conflicting_pairs(
    path, low, high, position, reach_m, most, least, pair, closeness
):  # pragma: no cover (compiled)
    """Number of conflicts; those for which there is room are written into `pair` and `closeness`.

    Steps at which all modes of two people keep apart are passed over, and so are single modes. Of more than
    `most`, the others are not counted.

    Args:
        path: see `_conflicts`. [N, K, P, 2]
        low: least coordinates of all modes, m. [N, P, 2]
        high: largest coordinates, m. [N, P, 2]
        position: see `_conflicts`. [N, 2]
        reach_m: people farther apart do not regard each other, m.
        most: conflicts.
        least: room for the squared distances of two people's modes. [K, K]
        pair: indices of both modes. [2, C]
        closeness: of both. [C]
    """
    people, modes, steps = path.shape[:3]
    total = 0
    for i in range(people):
        for j in range(i + 1, people):
            dx, dy = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
            regard = min((reach_m - math.sqrt(dx * dx + dy * dy)) / _FADE_M, 1.0)
            if regard <= 0.0:
                continue
            near = False
            for p in range(steps):
                if _apart(low[i, p, 0], high[i, p, 0], low[j, p, 0], high[j, p, 0]):
                    continue
                if _apart(low[i, p, 1], high[i, p, 1], low[j, p, 1], high[j, p, 1]):
                    continue
                if not near:
                    least[:], near = NEAR_M * NEAR_M, True
                for k in range(modes):
                    x, y = path[i, k, p, 0], path[i, k, p, 1]
                    if _apart(x, x, low[j, p, 0], high[j, p, 0]) or _apart(y, y, low[j, p, 1], high[j, p, 1]):
                        continue
                    for m in range(modes):
                        dx, dy = path[j, m, p, 0] - x, path[j, m, p, 1] - y
                        least[k, m] = min(least[k, m], dx * dx + dy * dy)
            for k in range(modes if near else 0):
                for m in range(modes):
                    if least[k, m] < NEAR_M * NEAR_M:
                        if total < len(closeness):
                            pair[0, total], pair[1, total] = i * modes + k, j * modes + m
                            closeness[total] = regard * (1.0 - math.sqrt(least[k, m]) / NEAR_M)
                        total += 1
            if total > most:
                return total
    return total


@compiled
def _apart(low, high, other_low, other_high):  # pragma: no cover (compiled)
    """Whether two intervals keep the distance."""
    return low - other_high >= NEAR_M or other_low - high >= NEAR_M
