"""Predicted occupancy as grids, one for each step."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pedpred.ros.message_types import MAP, TYPES
from pedpred.ros.scene_messages import Content, header, map_info
from pedpred.scenes import BODY_M, OccupancyMap, Predictions, predicted_occupancy

HORIZON, GRID_TYPE = "/predicted_occupancy/horizon", TYPES[MAP]

NO_MAP = re.compile(r"costmap|(^|/)predicted_occupancy/")
"""In topics of grids that are no maps: costs for planners, and where people are going to be."""
MOST_CELLS = 2**24
"""Of all steps together."""
SMALLEST_CELL_M = 0.1
"""Side of the smallest cells: a person is wider, and the time grows with the fourth power of their number."""
_PER_SPREAD, _MOST_DOUBLINGS = 2.0, 4
"""Cells are at most so many times smaller than the standard deviation of a person, and doubled so often."""
_REACH, _MARGIN = 4.0, 1.5
"""A mode covers so many standard deviations and cells around its path."""


def grid_topic(step: int) -> str:
    """Topic of the predicted occupancy at a step, from 1."""
    return f"/predicted_occupancy/step_{step}"


def grid_messages(
    predictions: Predictions,
    ground: OccupancyMap,
    time_ns: int,
    frame: str,
    horizon: bool = False,
    is_needed: Callable[[str], bool] = lambda topic: True,
) -> dict[str, Content]:
    """Topic -> nav_msgs/OccupancyGrid of each step: the probability that a person is in a cell, in per cent.

    The stamp of a grid is the time that it is about, its `map_load_time` the present. Static obstacles are
    not in it.

    Args:
        predictions: world frame.
        ground: the cells; its obstacles do not matter.
        time_ns: the present.
        frame: name of the world frame.
        horizon: add `HORIZON`, the largest value of all steps, stamped with the present: for costmaps,
            which have one value per cell.
        is_needed: whether a topic is.
    """
    info, messages = map_info(ground, time_ns), {}
    highest = np.zeros(ground.occupied.shape, np.int8)

    def grid(cells: np.ndarray, then_ns: int) -> Content:
        return {"header": header(then_ns, frame), "info": info, "data": cells.T.ravel()}

    needs_horizon = horizon and is_needed(HORIZON)
    for step in range(predictions.steps):
        topic = grid_topic(step + 1)
        if not (needs_horizon or is_needed(topic)):
            continue
        cells = _per_cent(_at(predictions, step), ground)
        np.maximum(highest, cells, out=highest)
        if is_needed(topic):
            messages[topic] = grid(cells, time_ns + round((step + 1) * predictions.dt_s * 1e9))
    if needs_horizon:
        messages[HORIZON] = grid(highest, time_ns)
    return messages


def _at(predictions: Predictions, step: int) -> Predictions:
    """A step, from 0, of the forecasts."""
    this = np.s_[..., step : step + 1, :]
    covariance = predictions.covariance
    spread = None if covariance is None else covariance[..., step : step + 1, :, :]
    return replace(predictions, point=predictions.point[this], path=predictions.path[this], covariance=spread)


def _per_cent(predictions: Predictions, ground: OccupancyMap) -> np.ndarray:
    """`predicted_occupancy` of one step on the cells of a ground, in per cent. [X, Y] int8.

    Wide modes are computed on cells of twice, four times ... the side, which takes a fraction of the time:
    the probability hardly changes over half a standard deviation.
    """
    spread = np.zeros(predictions.path.shape)
    if predictions.covariance is not None:
        spread = np.sqrt(np.diagonal(predictions.covariance, axis1=-2, axis2=-1))
    margin = _REACH * (spread + _MARGIN * ground.resolution_m) + BODY_M
    low, high = ((predictions.path + sign * margin)[:, :, 0] for sign in (-1, 1))
    near = np.isfinite(low).all(axis=2) & (high >= ground.origin).all(axis=2)
    near &= (low <= ground.origin + ground.extent_m).all(axis=2)
    cells_wide = spread.min(axis=(2, 3)) / (_PER_SPREAD * ground.resolution_m)
    factor = 2 ** np.minimum(np.log2(np.maximum(cells_wide, 1.0)).astype(int), _MOST_DOUBLINGS)
    free = np.ones(ground.occupied.shape, np.float32)
    for person in np.flatnonzero(near.any(axis=1)).tolist():
        some = near[person]
        first, end = _block(low[person, some], high[person, some], ground, 2**_MOST_DOUBLINGS)
        around = free[first[0] : end[0], first[1] : end[1]]
        covered = np.zeros_like(around)
        for size in np.unique(factor[person, some]).tolist():
            modes = some & (factor[person] == size)
            start, stop = _block(low[person, modes], high[person, modes], ground, size)
            coarse = OccupancyMap(
                np.zeros((stop - start) // size, bool),
                ground.origin + ground.resolution_m * start,
                size * ground.resolution_m,
            )
            cells = _covered(predictions, person, modes, coarse).repeat(size, axis=0).repeat(size, axis=1)
            there = covered[tuple(map(slice, start - first, stop - first))]
            there += cells[: there.shape[0], : there.shape[1]]
        around *= 1.0 - np.minimum(covered, 1.0)
    return np.rint(100 * (1.0 - free)).astype(np.int8)


def _block(
    low: np.ndarray, high: np.ndarray, ground: OccupancyMap, size: int
) -> tuple[np.ndarray, np.ndarray]:
    """First cells, and those after the last ones, of the squares of size x size cells around modes. [2], [2].

    Args:
        low: lower corners, m. [K, 2]
        high: upper corners, m. [K, 2]
        ground: the cells; the last square may reach beyond them.
        size: of a square.
    """
    ends = ground.cell_of(np.array([low.min(axis=0), high.max(axis=0)]))
    first, last = np.clip(ends, 0, np.array(ground.occupied.shape) - 1) // size * size
    return first, last + size


def _covered(predictions: Predictions, person: int, modes: np.ndarray, cells: OccupancyMap) -> np.ndarray:
    """The probability that a person covers each cell and is in one of some modes [K bool]. [X, Y]."""
    weight = predictions.weight[person, modes].astype(np.float64)
    covariance = predictions.covariance
    alone = replace(
        predictions,
        point=predictions.point[person][None],
        path=predictions.path[person, modes][None],
        weight=(weight / weight.sum())[None],
        covariance=None if covariance is None else covariance[person, modes][None],
    )
    return np.asarray(float(weight.sum()) * predicted_occupancy(alone, cells)[0])


def fitting_ground(occupancy: OccupancyMap, cell_m: float, steps: int) -> OccupancyMap:
    """The ground of a map without its obstacles, for grids of so many steps.

    Args:
        occupancy: the map.
        cell_m: side of a cell, `SMALLEST_CELL_M` at least; larger where there would be too many cells, m.
        steps: of the forecasts.
    """
    most, (width_m, height_m) = MOST_CELLS / steps, occupancy.extent_m
    side_m = np.sqrt(2.0 * width_m * height_m / most)
    along_m = 2.0 * (width_m + height_m) / (most - 2.0)
    return occupancy.free(max(cell_m, SMALLEST_CELL_M, float(side_m), float(along_m)))  # cells are whole
