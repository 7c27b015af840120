"""Forecasts as a table that planners read.

The table is a sensor_msgs/PointCloud2, one point per person, mode and step: no standard type holds modes with
weights and covariances of every step, and every ROS installation reads this one (`sensor_msgs_py`).
"""

from __future__ import annotations

import logging

import numpy as np

from pedpred.ros.scene_messages import Content, header
from pedpred.scenes import Predictions

PREDICTIONS, PREDICTIONS_TYPE = "/predictions", "sensor_msgs/msg/PointCloud2"

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
"""Columns of `/predictions`: x, y in m, z 0; RViz shows clouds whose coordinates have 32 bits, no others. The
track is track_high * 2^32 + track_id. Mode 0 is the most likely one. Steps count from 1, `time_s` after the
stamp. Covariances are those within a mode, m^2, or NaN.
"""

_DATATYPES = {"<u2": 4, "<i4": 5, "<u4": 6, "<f4": 7}
"""The constants of sensor_msgs/PointField."""
_ROUGH_M = 0.01


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
        text = "positions in %s are rounded to %.2g m: the origin of their frame is too far away"
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
    fields = [
        {"name": name, "offset": ROW.fields[name][1], "datatype": _DATATYPES[kind], "count": 1}  # type: ignore[index]
        for name, kind in _COLUMNS.items()
    ]
    sizes = {"height": 1, "width": len(rows), "point_step": ROW.itemsize, "row_step": rows.nbytes}
    data = np.frombuffer(rows.tobytes(), np.uint8)
    dense = predictions.covariance is not None
    return {"header": header(time_ns, frame), "fields": fields, **sizes, "data": data, "is_dense": dense}
