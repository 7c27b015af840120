"""Maps and people as ROS messages, and maps back.

Messages are nested dictionaries (`pedpred.ros.message_types.serialize`). An unknown velocity is NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap
from pedpred.scenes.occupancy import check_cells
from pedpred.scenes.turned_maps import turned_map

Content = dict[str, Any]
"""Fields of a message."""

FRAME, WORLD = "map", "world"

_OCCUPIED, _FREE, _UNKNOWN = 100, 0, -1
_LATEST_S = 2**31
_LEVEL = 1e-6
"""Largest x and y of the quaternion of a map that is level."""


def nanoseconds(time_s: np.ndarray) -> np.ndarray:
    """Round scene times (s, [M]) to whole nanoseconds, the unit of a recording: [M] int64.

    Raises:
        ValueRuleError: a time is negative or larger than a ROS stamp can hold.
    """
    outside = (time_s < 0) | (time_s >= _LATEST_S)
    if outside.any():
        rule = f"a ROS stamp holds 0 to {_LATEST_S} s: shift the scene's times"
        raise ValueRuleError("time_s", float(time_s[outside][0]), rule)
    return np.round(time_s * 1e9).astype(np.int64)


def stamp(time_ns: int) -> Content:
    """builtin_interfaces/Time; a later time than it can hold becomes the latest one."""
    time_ns = min(time_ns, _LATEST_S * 10**9 - 1)
    return {"sec": time_ns // 10**9, "nanosec": time_ns % 10**9}


def seconds(stamp: Any) -> float:
    """Convert a ROS time stamp to s."""
    return float(stamp.sec + stamp.nanosec / 1e9)


def header(time_ns: int, frame: str = FRAME) -> Content:
    """std_msgs/Header."""
    return {"stamp": stamp(time_ns), "frame_id": frame}


def point(position: np.ndarray, height_m: float = 0.0) -> Content:
    """geometry_msgs/Point."""
    return {"x": float(position[0]), "y": float(position[1]), "z": height_m}


def map_message(occupancy: OccupancyMap, time_ns: int) -> Content:
    """nav_msgs/OccupancyGrid: rows along x, the first at the smallest y."""
    data = np.where(occupancy.occupied.T, np.int8(_OCCUPIED), np.int8(_FREE)).ravel()
    return {"header": header(time_ns), "info": map_info(occupancy, time_ns), "data": data}


def map_info(occupancy: OccupancyMap, time_ns: int) -> Content:
    """nav_msgs/MapMetaData: the cells of a map."""
    width, height = occupancy.occupied.shape
    return {
        "map_load_time": stamp(time_ns),
        "resolution": occupancy.resolution_m,
        "width": width,
        "height": height,
        "origin": {"position": point(occupancy.origin), "orientation": {"w": 1.0}},
    }


def map_of_grid(message: Any) -> OccupancyMap:
    """The map of a nav_msgs/OccupancyGrid; cells above 50 are blocked, unknown ones (-1) are free.

    Args:
        message: decoded; the side of its cells is the shortest decimal that rounds to the message's float32.

    Raises:
        ValueRuleError: the map is empty, too large, tilted, nowhere or without size, or has not one value per
            cell, each unknown or a percentage.
    """
    straight, yaw_rad = _unturned(message)
    return turned_map(straight, yaw_rad) if yaw_rad else straight


def check_grid(message: Any) -> None:
    """Raise what `map_of_grid` raises of a message, but for a map that becomes too large as it is turned."""
    _unturned(message)


def _unturned(message: Any) -> tuple[OccupancyMap, float]:
    """The map of a nav_msgs/OccupancyGrid before it is turned about its corner, and the angle, rad."""
    info = message.info
    check_cells(info.width, info.height)
    yaw_rad = _yaw(info.origin.orientation)
    data = np.asarray(message.data)
    if len(data) != info.width * info.height:
        rule = f"a map of {info.width} x {info.height} cells has a value for each cell"
        raise ValueRuleError("data", f"{len(data)} values", rule)
    _check_values(data)
    cells = data.reshape(info.height, info.width).T
    origin = np.array([info.origin.position.x, info.origin.position.y])
    side_m = float(str(np.float32(info.resolution)))
    return OccupancyMap(blocked(cells), origin, side_m), yaw_rad


def blocked(data: np.ndarray) -> np.ndarray:
    """Which values of a nav_msgs/OccupancyGrid are those of blocked cells. [...] bool."""
    return data > _OCCUPIED / 2


def _check_values(data: np.ndarray) -> None:
    for value in (data.min(initial=_FREE), data.max(initial=_FREE)):
        if not _UNKNOWN <= value <= _OCCUPIED:
            rule = "cells are -1 (unknown) or 0 to 100 (per cent); publish raw costs as an OccupancyGrid"
            raise ValueRuleError("data", int(value), rule)


def updated_grid(grid: Any, update: Any) -> Any:
    """A nav_msgs/OccupancyGrid after a map_msgs/OccupancyGridUpdate; the one before stays as it is.

    Args:
        grid: the decoded map.
        update: decoded; new values of a rectangle of its cells.

    Raises:
        ValueRuleError: the update is in another frame, not within the map, or has not one value per cell,
            each unknown or a percentage.
    """
    if update.header.frame_id.lstrip("/") != grid.header.frame_id.lstrip("/"):
        rule = f"an update must be in the frame of its map, {grid.header.frame_id!r}"
        raise ValueRuleError("frame_id", update.header.frame_id, rule)
    cells = np.array(grid.data).reshape(grid.info.height, grid.info.width)
    shape, (rows, columns) = (update.height, update.width), cells.shape
    within = 0 <= update.x <= columns - update.width and 0 <= update.y <= rows - update.height
    if not within or len(update.data) != update.height * update.width:
        values = {"x": update.x, "y": update.y, "width": update.width, "height": update.height}
        rule = f"an update must lie within its map of {columns} x {rows} cells, with a value for each cell"
        raise ValueRuleError("update", values | {"values": len(update.data)}, rule)
    part = slice(update.y, update.y + update.height), slice(update.x, update.x + update.width)
    data = np.asarray(update.data)
    _check_values(data)
    cells[part] = data.reshape(shape)
    return replace(grid, data=cells.ravel())


def _yaw(turn: Any) -> float:
    """The angle by which a map is turned about the vertical, rad."""
    quaternion = np.array([turn.x, turn.y, turn.z, turn.w])
    if not (np.isfinite(quaternion).all() and np.abs(quaternion[:2]).max() < _LEVEL):
        raise ValueRuleError(
            "origin.orientation", quaternion.tolist(), "a map must be level: x and y must be 0"
        )
    yaw_rad = 2.0 * np.arctan2(turn.z, turn.w) if turn.z else 0.0
    return float(yaw_rad)


def frames_message(time_ns: int) -> Content:
    """tf2_msgs/TFMessage: the map lies at the world's origin."""
    identity = {"rotation": {"w": 1.0}}
    return {
        "transforms": [{"header": header(time_ns, WORLD), "child_frame_id": FRAME, "transform": identity}]
    }


def people_message(people: Mapping[str, list[Any]], time_ns: int) -> Content:
    """people_msgs/People: the columns of `tracks_table` at one instant."""
    columns = [people[name] for name in ("track_id", "x_m", "y_m")]
    unknown = [np.nan] * len(columns[0])
    columns += [people.get(name, unknown) for name in ("vx_mps", "vy_mps")]
    return {
        "header": header(time_ns),
        "people": [
            {
                "name": str(track),
                "position": {"x": x, "y": y},
                "velocity": {"x": vx, "y": vy},
                "reliability": 1.0,
            }
            for track, x, y, vx, vy in zip(*columns, strict=True)
        ],
    }
