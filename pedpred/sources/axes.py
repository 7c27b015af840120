"""Which columns of a text without titles are the axes of the ground, by how people move.

People walk steadily. A height, a confidence or a heading hardly changes along a track, or only jitters.
"""

from __future__ import annotations

import math

import numpy as np

_STEP_S, _STEPS = 0.4, 5
"""Time between the places of a track that are compared, and how many steps make a way."""
_FEWEST_WAYS = 10
_STEADY, _JITTER = 0.7, 0.5
"""Ways of somebody who walks are longer than the first share of the sum of their steps; less than the second
is noise."""
_SHORT, _LESS = 0.1, 0.5
"""Ways are short, and those of noise less, than by these shares of those along another column."""
_ALIKE = 5.0
"""Ways along both axes of the ground differ by less than this factor, in half of the cases."""
_SPREAD, _RELATED = 0.2, 0.95
"""A column is computed from another one if steps are in the same ratio, up to the first share, or values
have the same order, with a correlation above the second."""


def misplaced_axis(
    ground: np.ndarray, others: np.ndarray, track_id: np.ndarray, time_s: np.ndarray
) -> tuple[int, int] | None:
    """Find an axis along which nobody walks while everybody walks along another column.

    The other column must move as steadily and as far as the second axis does, and must be computed neither
    from that one nor from times, as the way since a track began is.

    Args:
        ground: the columns that are taken as x and y. [2, M]
        others: further columns; NaN where there is no number. [K, M]
        track_id: [M] int64
        time_s: s. [M]

    Returns:
        Which of x and y it is, and which of the others moves; None: all is well, or nothing is clear.
    """
    rows = others.shape[1] if len(others) else 0
    ground, track_id, time_s = ground[:, :rows], track_id[:rows], time_s[:rows]
    usable = [k for k, column in enumerate(others) if np.isfinite(column).all()]
    order, ways = _ways(track_id, time_s)
    if not usable or len(ways) < _FEWEST_WAYS:
        return None
    clock = _Way(time_s[order], ways)
    axes = [_Way(column[order], ways) for column in ground]
    for at, axis in enumerate(axes):
        beside = axes[1 - at]
        for k in usable:
            other = _Way(others[k][order], ways)
            if other.is_axis_beside(beside, clock) and axis.hardly_moves(other):
                return at, k
    return None


class _Way:
    """How the values of a column change on the ways of people. Places of their rows in order: [W, S + 1]."""

    def __init__(self, values: np.ndarray, ways: np.ndarray) -> None:
        self.values = values
        along = values[ways]
        self.far = np.abs(along[:, -1] - along[:, 0])
        self.usual = float(np.median(self.far))
        steps = np.abs(np.diff(along, axis=1)).sum(axis=1)
        self.steadiness = float(np.median(self.far / np.maximum(steps, 1e-12)))

    def hardly_moves(self, other: _Way) -> bool:
        """Whether nobody walks along this column, compared with another one."""
        jitters = self.steadiness < _JITTER and self.usual <= _LESS * other.usual
        return jitters or self.usual <= _SHORT * other.usual

    def is_axis_beside(self, axis: _Way, clock: _Way) -> bool:
        """Whether people walk along this column and an axis of the ground, and it tells more than that."""
        if min(self.steadiness, axis.steadiness) < _STEADY:
            return False
        if not axis.usual / _ALIKE < self.usual < axis.usual * _ALIKE:
            return False
        return not (self._follows(clock) or self._follows(axis) or self._has_order_of(axis))

    def _follows(self, other: _Way) -> bool:
        moved = other.far > 0.0
        ratio = self.far[moved] / other.far[moved]
        if not len(ratio):
            return True
        low, usual, high = (float(np.percentile(ratio, share)) for share in (25, 50, 75))
        return bool(high - low <= _SPREAD * usual)

    def _has_order_of(self, other: _Way) -> bool:
        ranks = [np.argsort(np.argsort(way.values)) for way in (self, other)]
        return bool(abs(np.asarray(np.corrcoef(ranks))[0, 1]) > _RELATED)


def _ways(track_id: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows in the order of tracks and times, and in it the places of rows along each way. [M], [W, S + 1]."""
    order = np.lexsort((time_s, track_id))
    who, when = track_id[order], time_s[order]
    steps = np.diff(when)[np.diff(who) == 0]
    usual_s = float(np.median(steps)) if len(steps) else math.inf
    every = max(1, math.ceil(_STEP_S / usual_s - 1e-6)) if usual_s > 0 else 1
    first = np.arange(0, max(len(order) - every * _STEPS, 0), every)
    ways = first[:, None] + every * np.arange(_STEPS + 1)
    return order, ways[who[ways[:, 0]] == who[ways[:, -1]]]
