"""Forecasts as messages that planners read: a table of modes, and grids of predicted occupancy.

The table is a sensor_msgs/PointCloud2, one point per person, mode and step: no standard type holds modes with
weights and covariances of every step, and every ROS installation reads this one (`sensor_msgs_py`).
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pedpred.ros.message_types import MAP, TYPES
from pedpred.ros.scene_messages import Content, header, map_info
from pedpred.scenes import BODY_M, OccupancyMap, Predictions, predicted_occupancy

PREDICTIONS, HORIZON = "/predictions", "/predicted_occupancy/horizon"
PREDICTIONS_TYPE, GRID_TYPE = "sensor_msgs/msg/PointCloud2", TYPES[MAP]

NO_MAP = re.compile(r"costmap|(^|/)predicted_occupancy/")
"""In topics of grids that are no maps: costs for planners, and where people are going to be."""
MOST_CELLS = 2**24
"""Of all steps of predicted occupancy together."""
SMALLEST_CELL_M = 0.1
"""Side of the smallest cells: a person is wider, and the time grows with the fourth power of their number."""
_PER_SPREAD, _MOST_DOUBLINGS = 2.0, 4
"""Cells are at most so many times smaller than the standard deviation of a person, and doubled so often."""
_REACH, _MARGIN = 4.0, 1.5
"""Nobody is expected beyond so many standard deviations and cells around a path."""

_COLUMNS = {
    "x": "<f4",
    "y": "<f4",
    "z": "<f4",
    "track_id": "<u4",
    "track_high": "<i4",
    "mode": "<u2",
    "step": "<u2",
    "time_s": "<f4",
    "weight": "<f4",
    "cov_xx": "<f4",
    "cov_xy": "<f4",
    "cov_yy": "<f4",
}
ROW = np.dtype(list(_COLUMNS.items()))
"""Columns of `/predictions`: x, y in m, z 0; RViz shows clouds whose places have 32 bits, no others. The
track is track_high * 2^32 + track_id. Mode 0 is the most likely one. Steps count from 1, `time_s` after the
stamp. Covariances are those within a mode, m^2, or NaN.
"""

_ROUGH_M = 0.01

_DATATYPES = {"<u2": 4, "<i4": 5, "<u4": 6, "<f4": 7}
"""The constants of sensor_msgs/PointField."""


def grid_topic(step: int) -> str:
    """Topic of the predicted occupancy at a step, from 1."""
    return f"/predicted_occupancy/step_{step}"


def prediction_rows(track_id: np.ndarray, predictions: Predictions) -> np.ndarray:
    """The table of all people [N] with their modes and steps. [N * K * P] of `ROW`."""
    shape = (len(predictions), predictions.modes, predictions.steps)
    person, mode, step = (index.ravel() for index in np.indices(shape))
    rows = np.zeros(len(person), ROW)
    rows["x"], rows["y"] = predictions.path.reshape(-1, 2).T
    rows["track_id"], rows["track_high"] = (track_id & 0xFFFFFFFF)[person], (track_id >> 32)[person]
    rows["mode"], rows["step"], rows["time_s"] = mode, step + 1, (step + 1) * predictions.dt_s
    rows["weight"] = predictions.weight[person, mode]
    unknown = np.full((*shape, 2, 2), np.nan)
    covariance = unknown if predictions.covariance is None else predictions.covariance
    spread = covariance.reshape(-1, 2, 2)
    rows["cov_xx"], rows["cov_xy"], rows["cov_yy"] = spread[:, 0, 0], spread[:, 0, 1], spread[:, 1, 1]
    return rows


def warn_of_rounding(predictions: Predictions, log: logging.Logger) -> None:
    """Warn if the table cannot hold the farthest path to the centimetre, as in UTM coordinates."""
    rounded_m = np.spacing(np.float32(np.abs(predictions.path).max(initial=0.0)))
    if rounded_m > _ROUGH_M:
        text = "places in %s are rounded to %.2g m: the origin of their frame is too far away"
        log.warning(text, PREDICTIONS, rounded_m)


def predictions_message(track_id: np.ndarray, predictions: Predictions, time_ns: int, frame: str) -> Content:
    """sensor_msgs/PointCloud2: the table of some people's forecasts at an instant.

    Args:
        track_id: [N] int64
        predictions: world frame. N rows.
        time_ns: the present.
        frame: name of the world frame.
    """
    rows = prediction_rows(track_id, predictions)
    ends = np.cumsum([ROW[name].itemsize for name in _COLUMNS]).tolist()
    fields = [
        {"name": name, "offset": offset, "datatype": _DATATYPES[kind], "count": 1}
        for (name, kind), offset in zip(_COLUMNS.items(), [0, *ends[:-1]], strict=True)
    ]
    sizes = {"height": 1, "width": len(rows), "point_step": ROW.itemsize, "row_step": rows.nbytes}
    data = np.frombuffer(rows.tobytes(), np.uint8)
    dense = predictions.covariance is not None
    return {"header": header(time_ns, frame), "fields": fields, **sizes, "data": data, "is_dense": dense}


def grid_messages(
    predictions: Predictions,
    ground: OccupancyMap,
    time_ns: int,
    frame: str,
    horizon: bool = False,
    is_wanted: Callable[[str], bool] = lambda topic: True,
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
        is_wanted: whether a topic is needed.
    """
    info, messages = map_info(ground, time_ns), {}
    highest = np.zeros(ground.occupied.shape, np.int8)

    def grid(cells: np.ndarray, then_ns: int) -> Content:
        return {"header": header(then_ns, frame), "info": info, "data": cells.T.ravel()}

    needs_horizon = horizon and is_wanted(HORIZON)
    for step in range(predictions.steps):
        topic = grid_topic(step + 1)
        if not (needs_horizon or is_wanted(topic)):
            continue
        cells = _per_cent(_at(predictions, step), ground)
        np.maximum(highest, cells, out=highest)
        if is_wanted(topic):
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
    doublings = np.minimum(np.log2(np.maximum(cells_wide, 1.0)).astype(int), _MOST_DOUBLINGS)
    free, covered = np.ones(ground.occupied.shape, np.float32), np.zeros(ground.occupied.shape, np.float32)
    for person in np.flatnonzero(near.any(axis=1)).tolist():
        for number in np.unique(doublings[person, near[person]]):
            modes = near[person] & (doublings[person] == number)
            ends = np.array([low[person, modes].min(axis=0), high[person, modes].max(axis=0)])
            _add_modes(covered, _modes_of(predictions, person, modes), ground, ends, 2 ** int(number))
        ends = np.array([low[person, near[person]].min(axis=0), high[person, near[person]].max(axis=0)])
        first, last = np.maximum(ground.cell_of(ends) + np.array([[-1], [1]]) * 2**_MOST_DOUBLINGS, 0)
        there = np.s_[first[0] : last[0] + 1, first[1] : last[1] + 1]
        free[there] *= 1.0 - np.minimum(covered[there], 1.0)
        covered[there] = 0.0
    return np.rint(100 * (1.0 - free)).astype(np.int8)


def _modes_of(predictions: Predictions, person: int, modes: np.ndarray) -> tuple[Predictions, float]:
    """Some modes [K bool] of a person as if there were no others, and their share of the probability."""
    weight = predictions.weight[person, modes].astype(np.float64)
    covariance = predictions.covariance
    alone = replace(
        predictions,
        point=predictions.point[person][None],
        path=predictions.path[person, modes][None],
        weight=(weight / weight.sum())[None],
        covariance=None if covariance is None else covariance[person, modes][None],
    )
    return alone, float(weight.sum())


def _add_modes(
    covered: np.ndarray,
    part: tuple[Predictions, float],
    ground: OccupancyMap,
    ends: np.ndarray,
    factor: int,
) -> None:
    """Add to the probability that a person covers a cell.

    Args:
        covered: of the cells of the ground, changed in place. [X, Y]
        part: modes of one step, and their share.
        ground: the cells.
        ends: lower and upper corner of a box around the modes, m. [2, 2]
        factor: cells along each side that are computed as one.
    """
    predictions, share = part
    first, last = np.clip(ground.cell_of(ends), 0, np.array(covered.shape) - 1) // factor
    side_m = factor * ground.resolution_m
    coarse = OccupancyMap(np.zeros(last - first + 1, bool), ground.origin + side_m * first, side_m)
    taken = share * predicted_occupancy(predictions, coarse)[0]
    around = covered[factor * first[0] :, factor * first[1] :]
    cells = taken.repeat(factor, axis=0).repeat(factor, axis=1)[: around.shape[0], : around.shape[1]]
    around[: cells.shape[0], : cells.shape[1]] += cells


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
