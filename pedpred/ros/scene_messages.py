"""Maps and people as ROS messages, and maps back.

Messages are nested dictionaries (`pedpred.ros.message_types.serialize`). An unknown velocity is NaN.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
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


# Maps


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
    check_grid(message)
    info = message.info
    cells = np.asarray(message.data).reshape(info.height, info.width).T
    origin = np.array([info.origin.position.x, info.origin.position.y])
    straight = OccupancyMap(blocked(cells), origin, float(str(np.float32(info.resolution))))
    turn = info.origin.orientation
    yaw_rad = 2.0 * float(np.arctan2(turn.z, turn.w)) if turn.z else 0.0
    return turned_map(straight, yaw_rad) if yaw_rad else straight


def check_grid(message: Any) -> None:
    """Check the size, the values and the pose of a nav_msgs/OccupancyGrid; errors as of `map_of_grid`."""
    info, turn = message.info, message.info.origin.orientation
    check_cells(info.width, info.height)
    _check_values(np.asarray(message.data), info.width, info.height)
    quaternion = np.array([turn.x, turn.y, turn.z, turn.w])
    if not (np.isfinite(quaternion).all() and np.abs(quaternion[:2]).max() < _LEVEL):
        rule = "a map must be level: x and y must be 0"
        raise ValueRuleError("origin.orientation", quaternion.tolist(), rule)


def blocked(data: np.ndarray) -> np.ndarray:
    """Which values of a nav_msgs/OccupancyGrid are those of blocked cells. [...] bool."""
    return data > _OCCUPIED / 2


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
    width, height = grid.info.width, grid.info.height
    if not (0 <= update.x <= width - update.width and 0 <= update.y <= height - update.height):
        rectangle = {name: getattr(update, name) for name in ("x", "y", "width", "height")}
        raise ValueRuleError("update", rectangle, f"an update must lie within its map of {width} x {height}")
    data = np.asarray(update.data)
    _check_values(data, update.width, update.height)
    cells = np.array(grid.data).reshape(height, width)
    rows, columns = slice(update.y, update.y + update.height), slice(update.x, update.x + update.width)
    cells[rows, columns] = data.reshape(update.height, update.width)
    return replace(grid, data=cells.ravel())


def _check_values(data: np.ndarray, width: int, height: int) -> None:
    if len(data) != width * height:
        rule = f"{width} x {height} cells need a value each"
        raise ValueRuleError("data", f"{len(data)} values", rule)
    for value in (data.min(initial=_FREE), data.max(initial=_FREE)):
        if not _UNKNOWN <= value <= _OCCUPIED:
            rule = "cells are -1 (unknown) or 0 to 100 (per cent); publish raw costs as an OccupancyGrid"
            raise ValueRuleError("data", int(value), rule)


# Frames and people


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
    rows = zip(*columns, strict=True)
    return {
        "header": header(time_ns),
        "people": [person(str(track), (x, y), (vx, vy)) for track, x, y, vx, vy in rows],
    }


def person(name: str, position: Iterable[float], velocity: Iterable[float]) -> Content:
    """people_msgs/Person, with x and y of position, m, and velocity, m/s."""
    return {
        "name": name,
        "position": dict(zip("xy", map(float, position), strict=True)),
        "velocity": dict(zip("xy", map(float, velocity), strict=True)),
        "reliability": 1.0,
    }
