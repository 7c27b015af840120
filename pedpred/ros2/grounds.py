"""The ground under grids of predicted occupancy."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable

import numpy as np

from pedpred.ros.planning import fitting_ground, least_cell_m, reached_cells, reached_ground
from pedpred.scenes import OccupancyMap, Predictions

_COVERED_S = 3.0
"""Costmaps read grids now and then, nearly all of them at least once in this time."""
_LARGE_M = 0.3
"""In larger cells hardly anything is seen of a person."""
_NO_CELL = 1e-6
"""Share of a cell that is no cell."""
_log = logging.getLogger(__name__)


class Grounds:
    """Chooses the cells of each grid: those of the map, or around people, and where people were just shown.

    A costmap reads the last grid alone, and keeps what it has of cells that this one does not hold.

    Args:
        clock: gives seconds; never stops or jumps.
        detail_m: see `pedpred.ros.planning.grid_messages`, m.
    """

    def __init__(self, clock: Callable[[], float], detail_m: float):
        self._clock, self._detail_m = clock, detail_m
        self._latest: OccupancyMap | None = None
        self._frame = ""
        self._shown: deque[tuple[float, np.ndarray]] = deque()

    def ground(
        self, predictions: Predictions, there: OccupancyMap | None, frame: str, cell_m: float
    ) -> tuple[OccupancyMap, Predictions]:
        """The cells of a grid, those before where nobody is there or cells have no size, and who is in it.

        Where people were just shown is left out if cells would be larger for it. Without a map, people are
        left out who are so far away that for them cells would be too large to show anybody: else one false
        detection would hide all others.

        Args:
            predictions: world frame.
            there: the map, if there is one.
            frame: of both.
            cell_m: side of a cell, larger where there would be too many; 0 if nobody is shown any more, m.
        """
        if frame != self._frame:
            self._frame, self._latest = frame, None
            self._shown.clear()
        if self._latest is not None and not (cell_m and (len(predictions) or there)):
            return self._latest, predictions
        now_s = self._clock()
        while self._shown and now_s - self._shown[0][0] > _COVERED_S:
            self._shown.popleft()
        if there is None:
            predictions = predictions.select(self._together(predictions, cell_m))
        reach = reached_ground(predictions, cell_m, self._detail_m)
        alone = there or OccupancyMap.free_around(reach, 0.0 if len(reach) else 1.0, cell_m)
        ground = fitting_ground(alone, cell_m, predictions.steps)
        rim_m, (low, high) = _NO_CELL * ground.resolution_m, _ends(ground)
        ends = np.vstack([low, high, *(shown for _, shown in self._shown)])
        if (ends < low - rim_m).any() or (ends > high + rim_m).any():
            wide = fitting_ground(OccupancyMap.free_around(ends, 0.0, cell_m), cell_m, predictions.steps)
            ground = wide if wide.resolution_m <= ground.resolution_m else ground
        if len(reach):
            part = reached_cells(predictions, ground, self._detail_m)
            cells = np.array([[each.start for each in part], [each.stop for each in part]])
            self._shown.append((now_s, ground.origin + ground.resolution_m * cells))
        self._latest = ground
        return ground, predictions

    def _together(self, predictions: Predictions, cell_m: float) -> np.ndarray:
        """Who can be on one ground: those nearest to most of all, or to where people were just shown. [N]."""
        largest_m, each = max(cell_m, _LARGE_M), np.arange(len(predictions))
        all_ends = reached_ground(predictions, cell_m, self._detail_m)
        kept = np.ones(len(predictions), bool)
        if not len(all_ends) or least_cell_m(all_ends[1] - all_ends[0], predictions.steps) <= largest_m:
            return kept
        ends = np.stack([reached_ground(predictions.select(each == n), cell_m, self._detail_m) for n in each])
        middle = ends.mean(axis=1)
        before = [shown.mean(axis=0) for _, shown in list(self._shown)[-1:]]  # it decides between two
        centre = np.median([*middle, *before], axis=0)
        order = np.argsort(np.abs(middle - centre).max(axis=1), kind="stable")
        low, high = (
            np.minimum.accumulate(ends[order, 0], axis=0),
            np.maximum.accumulate(ends[order, 1], axis=0),
        )
        fits = least_cell_m(high - low, predictions.steps) <= largest_m
        kept[order[1:][~fits[1:]]] = False
        text = "%d of %d people are too far from the others for predicted_occupancy: give a map"
        _log.warning(text, (~kept).sum(), len(kept))
        return kept


def _ends(ground: OccupancyMap) -> np.ndarray:
    """Lowest and highest corner, m. [2, 2]."""
    return np.stack([ground.origin, ground.origin + ground.extent_m])
