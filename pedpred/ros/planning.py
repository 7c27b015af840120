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
_MOST_OF_ONE, _MOST_OF_ALL = 20_000, 2_000_000
"""Squares in which one person is expected at a step, and all are; where there would be more, they grow."""

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
        detail_m: cells share a value in squares of at most this side, since small ones take long, m; those of
            a person who may be in too many of them at a step are larger.
    """
    group, part = _group(ground.resolution_m, detail_m), reached_cells(predictions, ground, detail_m)
    corner = ground.origin + ground.resolution_m * np.array([each.start for each in part])
    cut = OccupancyMap(ground.occupied[part], corner, ground.resolution_m)
    squares = _expected(predictions, cut.free(group * cut.resolution_m))
    per_cent = _repeated(np.rint(100 * squares).astype(np.int8), group, cut)
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


def _expected(predictions: Predictions, squares: OccupancyMap) -> np.ndarray:
    """`predicted_occupancy`, in larger squares of those who may be nearly anywhere. [P, X, Y].

    Somebody new may be within tens of metres after 3 s: in small squares, twenty such people take seconds.
    """
    free = np.ones((predictions.steps, *squares.occupied.shape), np.float32)
    for step in range(predictions.steps):
        then = _at(predictions, step)
        larger = _larger(then, squares)
        for times in np.unique(larger).tolist():
            cells = squares.free(times * squares.resolution_m)
            taken = predicted_occupancy(then.select(larger == times), cells)
            free[step] *= 1.0 - _repeated(taken, times, squares)[0]
    return 1.0 - free


def _at(predictions: Predictions, step: int) -> Predictions:
    """Of all steps only this one, from 0."""
    point, path, covariance = predictions.point, predictions.path, predictions.covariance
    this = np.s_[..., step : step + 1, :]
    spread = None if covariance is None else covariance[..., step : step + 1, :, :]
    return replace(predictions, point=point[this], path=path[this], covariance=spread)


def _larger(predictions: Predictions, ground: OccupancyMap) -> np.ndarray:
    """How many times larger squares are, few of which hold a person's forecast of one step. [N] int."""
    ends = _ends(predictions, ground.resolution_m)
    reach = np.diff(np.clip((ends - ground.origin) / ground.resolution_m, 0, ground.occupied.shape), axis=0)
    most = min(_MOST_OF_ONE, _MOST_OF_ALL / max(len(predictions), 1))
    times = np.sqrt(reach.prod(axis=-1)[0] / most)
    return 2 ** np.ceil(np.log2(np.maximum(np.nan_to_num(times), 1.0))).astype(np.int64)


def _repeated(squares: np.ndarray, times: int, ground: OccupancyMap) -> np.ndarray:
    """The cells of a ground, of which so many along each side share the value of a square. [P, X, Y]."""
    cells = squares.repeat(times, axis=1).repeat(times, axis=2)
    return cells[:, : ground.occupied.shape[0], : ground.occupied.shape[1]]


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
    low, high = _ends(predictions, _group(cell_m, detail_m) * cell_m)
    known = np.isfinite(low).all(axis=1)
    if not known.any():
        return np.zeros((0, 2))
    return np.clip([low[known].min(axis=0), high[known].max(axis=0)], -FARTHEST_M, FARTHEST_M)


def _ends(predictions: Predictions, side_m: float) -> np.ndarray:
    """Lowest and highest corner of where each person is expected, with a margin of cells, m. [2, N, 2]."""
    path = np.clip(predictions.path, -FARTHEST_M, FARTHEST_M)  # where a map can begin
    spread = np.zeros(path.shape)
    if predictions.covariance is not None:
        spread = np.sqrt(np.diagonal(predictions.covariance, axis1=-2, axis2=-1))
    wide = _DEVIATIONS * (spread + _MARGIN * side_m) + BODY_M
    return np.stack([(path - wide).min(axis=(1, 2)), (path + wide).max(axis=(1, 2))])


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
