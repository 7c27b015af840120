"""Forecasts as messages that planners read: a table of modes, and grids of predicted occupancy.

The table is a sensor_msgs/PointCloud2, one point per person, mode and step: no standard type holds modes with
weights and covariances of every step, and every ROS installation reads this one (`sensor_msgs_py`).
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable

import numpy as np

from pedpred.ros.message_types import MAP, TYPES
from pedpred.ros.scene_messages import Content, header, map_info
from pedpred.scenes import BODY_M, OccupancyMap, Predictions, predicted_occupancy
from pedpred.scenes.occupancy import FARTHEST_M

PREDICTIONS, HORIZON = "/predictions", "/predicted_occupancy/horizon"
PREDICTIONS_TYPE, GRID_TYPE = "sensor_msgs/msg/PointCloud2", TYPES[MAP]

NO_MAP = re.compile(r"costmap|(^|/)predicted_occupancy/")
"""In topics of grids that are no maps: costs for planners, and where people are going to be."""
MOST_CELLS = 2**24
"""Of all steps of predicted occupancy together."""
_DEVIATIONS, _MARGIN = 4.0, 1.5
"""A person's rectangle ends so many standard deviations and cells beyond the paths."""
_NO_CELL = 1e-6
"""Share of a cell that is no cell."""

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


def tell_rounding(predictions: Predictions, log: logging.Logger) -> None:
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
    detail_m: float = 0.0,
) -> dict[str, Content]:
    """Topic -> nav_msgs/OccupancyGrid of each step: how likely somebody is in a cell, in per cent.

    The stamp of a grid is the time that it is about, its `map_load_time` the present. Static obstacles are
    not in it.

    Args:
        predictions: world frame.
        ground: the cells; its obstacles do not matter.
        time_ns: the present.
        frame: name of the world frame.
        horizon: add `HORIZON`, the largest value of all steps, stamped with the present: for costmaps,
            which have one value per cell.
        is_wanted: whether somebody wants a topic.
        detail_m: cells share a value in squares of at most this side, since small ones take long, m.
    """
    group, part = _group(ground.resolution_m, detail_m), reached_cells(predictions, ground, detail_m)
    corner = ground.origin + ground.resolution_m * np.array([each.start for each in part])
    cut = OccupancyMap(ground.occupied[part], corner, ground.resolution_m)
    squares = np.rint(100 * predicted_occupancy(predictions, cut.free(group * cut.resolution_m)))
    per_cent = squares.astype(np.int8).repeat(group, axis=1).repeat(group, axis=2)
    per_cent = per_cent[:, : cut.occupied.shape[0], : cut.occupied.shape[1]]
    info = map_info(ground, time_ns)

    def grid(cells: np.ndarray, then_ns: int) -> Content:
        whole = np.zeros(ground.occupied.shape[::-1], np.int8)
        whole.T[part] = cells
        return {"header": header(then_ns, frame), "info": info, "data": whole.ravel()}

    messages = {}
    for step, cells in enumerate(per_cent, start=1):
        topic = grid_topic(step)
        if is_wanted(topic):
            messages[topic] = grid(cells, time_ns + round(step * predictions.dt_s * 1e9))
    if horizon and is_wanted(HORIZON):
        messages[HORIZON] = grid(per_cent.max(axis=0, initial=0), time_ns)
    return messages


def reached_cells(predictions: Predictions, ground: OccupancyMap, detail_m: float) -> tuple[slice, slice]:
    """The cells of a rectangle, one at least, beyond which `grid_messages` expects nobody.

    Args:
        predictions: world frame.
        ground: the cells.
        detail_m: see `grid_messages`; the rectangle begins where a square does, from the first cell on, m.
    """
    last, group = np.array(ground.occupied.shape) - 1, _group(ground.resolution_m, detail_m)
    reach = reached_ground(predictions, ground.resolution_m, detail_m)
    if not len(reach):
        return slice(0, 1), slice(0, 1)
    first, end = (np.clip(ground.cell_of(each), 0, last).tolist() for each in reach)
    first = [at // group * group for at in first]
    return slice(first[0], end[0] + 1), slice(first[1], end[1] + 1)


def reached_ground(predictions: Predictions, cell_m: float, detail_m: float) -> np.ndarray:
    """Lowest and highest corner of a rectangle beyond which nobody is expected; none if nobody is. m. [2, 2].

    Args:
        predictions: world frame.
        cell_m: side of a cell, m.
        detail_m: see `grid_messages`, m.
    """
    path = np.clip(predictions.path.reshape(-1, 2), -FARTHEST_M, FARTHEST_M)  # where a map can begin
    spread = np.zeros((len(path), 2))
    if predictions.covariance is not None:
        spread = np.sqrt(np.diagonal(predictions.covariance, axis1=-2, axis2=-1)).reshape(-1, 2)
    known = np.isfinite(path).all(axis=1)
    side_m = _group(cell_m, detail_m) * cell_m
    path, wide = path[known], _DEVIATIONS * (spread[known] + _MARGIN * side_m) + BODY_M
    if not len(path):
        return path
    return np.clip([(path - wide).min(axis=0), (path + wide).max(axis=0)], -FARTHEST_M, FARTHEST_M)


def _group(cell_m: float, detail_m: float) -> int:
    """Cells per side of a square that share a value."""
    return max(int(detail_m / cell_m * (1.0 + _NO_CELL)), 1)


def fitting_ground(ground: OccupancyMap, cell_m: float, steps: int) -> OccupancyMap:
    """The ground of a map without its obstacles, for grids of so many steps.

    Args:
        ground: the map.
        cell_m: side of a cell; larger where there would be too many cells, m.
        steps: of the forecasts.
    """
    return ground.free(max(cell_m, float(least_cell_m(ground.extent_m, steps))))


def least_cell_m(extent_m: np.ndarray, steps: int) -> np.ndarray:
    """The smallest side of a cell for grids of so many steps on a ground of a size, m. [..., 2] -> [...]."""
    most, (width_m, height_m) = MOST_CELLS / steps, np.moveaxis(np.asarray(extent_m), -1, 0)
    side_m = np.sqrt(2.0 * width_m * height_m / most)
    along_m = 2.0 * (width_m + height_m) / (most - 2.0)
    return np.asarray(np.maximum(side_m, along_m))  # (w/c + 1) (h/c + 1) <= most, as cells are whole
