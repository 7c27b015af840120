"""Scenes and forecasts as ROS 2 messages: nested dictionaries with the fields of `interfaces.msg`.

What `people_msgs` has no field for travels in a person's tags, as text that Python reads back exactly;
an unknown velocity is NaN.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from pedpred.errors import ValueRuleError
from pedpred.evaluation.calibration import radius2
from pedpred.geometry import rotate
from pedpred.scenes import OccupancyMap
from pedpred.storage.windows import Windows

Message = dict[str, Any]
Colour = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""

FRAME = "map"
WORLD = "world"
TAGS = ("time_s", "goal_x_m", "goal_y_m", "desired_speed_mps", "group_id")
"""Columns of `tracks_table` that become tags."""

OCCUPIED, FREE = 100, 0
_LATEST_S = 2**31
_ADD, _DELETE_ALL = 0, 3
_ARROW, _CYLINDER, _LINE_STRIP = 0, 3, 4
_PERSON_M = {"x": 0.4, "y": 0.4, "z": 1.7}
_ARROW_M = {"x": 0.05, "y": 0.12, "z": 0.15}
"""Shaft diameter, head diameter, head length."""
_LINE_M = 0.05
_HEIGHT_M = 0.02
"""Paths lie this far above the map, so that neither hides the other."""
_ARROW_S = 0.75
"""A velocity arrow ends where its person would be after this time."""
_REGION = 0.9
"""Share of the probability inside an error ellipse."""
_INK: Colour = (0.13, 0.13, 0.13)


def namespaces(method: str) -> tuple[str, str]:
    """Markers of a method: its paths and its error ellipses, to be switched on and off."""
    return method, f"{method} ellipse"


def nanoseconds(time_s: np.ndarray) -> np.ndarray:
    """Scene times (s, [M]) as whole nanoseconds, the clock of a recording: [M] int64.

    Raises:
        ValueRuleError: a time is negative or beyond what a ROS stamp can hold.
    """
    beyond = (time_s < 0) | (time_s >= _LATEST_S)
    if beyond.any():
        rule = f"a ROS stamp holds 0 to {_LATEST_S} s: shift the scene's clock"
        raise ValueRuleError("time_s", float(time_s[beyond][0]), rule)
    return np.round(time_s * 1e9).astype(np.int64)


def map_message(occupancy: OccupancyMap, time_ns: int) -> Message:
    """nav_msgs/OccupancyGrid: rows along x, the first at the smallest y."""
    width, height = occupancy.occupied.shape
    return {
        "header": _header(time_ns),
        "info": {
            "map_load_time": _stamp(time_ns),
            "resolution": occupancy.resolution_m,
            "width": width,
            "height": height,
            "origin": {"position": _point(occupancy.origin), "orientation": {"w": 1.0}},
        },
        "data": np.where(occupancy.occupied.T, OCCUPIED, FREE).ravel().tolist(),
    }


def frames_message(time_ns: int) -> Message:
    """tf2_msgs/TFMessage: the map lies at the world's origin."""
    parent = {"stamp": _stamp(time_ns), "frame_id": WORLD}
    unmoved = {"translation": {}, "rotation": {"w": 1.0}}
    return {"transforms": [{"header": parent, "child_frame_id": FRAME, "transform": unmoved}]}


def people_message(people: pd.DataFrame, time_ns: int) -> Message:
    """people_msgs/People: the rows of `tracks_table` at one instant."""
    tags = [name for name in TAGS if name in people]
    return {
        "header": _header(time_ns),
        "people": [
            {
                "name": str(row["track_id"]),
                "position": {"x": row["x_m"], "y": row["y_m"]},
                "velocity": {"x": row.get("vx_mps", np.nan), "y": row.get("vy_mps", np.nan)},
                "reliability": 1.0,
                "tagnames": tags,
                "tags": [repr(row[tag]) for tag in tags],
            }
            for row in people.to_dict("records")
        ],
    }


def markers_message(
    people: pd.DataFrame,
    windows: Windows | None,
    rows: np.ndarray,
    colours: Mapping[str, Colour],
    time_ns: int,
) -> Message:
    """visualization_msgs/MarkerArray: one whole picture, which replaces the one before.

    Args:
        people: rows of `tracks_table` at this instant, drawn as cylinders.
        windows: forecasts of the scene, or None.
        rows: its windows at this instant. [n] int
        colours: of each method to be drawn; its name is the markers' namespace.
        time_ns: the instant.
    """
    header = _header(time_ns)
    markers = [{"header": header, "action": _DELETE_ALL}]
    for track, x, y in people[["track_id", "x_m", "y_m"]].itertuples(index=False):
        pose = {"position": {"x": x, "y": y, "z": _PERSON_M["z"] / 2}, "orientation": {"w": 1.0}}
        markers.append(_marker(header, "people", track, _CYLINDER, _PERSON_M, _INK, 0.6) | {"pose": pose})
    if windows is not None:
        markers += _window_markers(windows, rows, colours, header)
    return {"markers": markers}


def _window_markers(
    windows: Windows, rows: np.ndarray, colours: Mapping[str, Colour], header: Message
) -> Iterator[Message]:
    """The tracked velocity as an arrow, the true path and the forecast ones as lines; error ellipses."""
    paths = {"truth": (windows.truth, _INK)}
    paths |= {method: (windows.paths[method], colour) for method, colour in colours.items()}
    velocity = rotate(windows.velocity[rows], windows.heading_rad[rows])
    for row, ahead in zip(rows, _ARROW_S * velocity, strict=True):
        track, start = windows.track_id[row], windows.position[row]
        arrow = _marker(header, "velocity", track, _ARROW, _ARROW_M, _INK, 1.0)
        yield arrow | {"points": [_point(start), _point(start + ahead)]}
        for name, (path, colour) in paths.items():
            line = _marker(header, name, track, _LINE_STRIP, {"x": _LINE_M}, colour, 1.0)
            yield line | {"points": [_point(point, _HEIGHT_M) for point in [start, *path[row]]]}
            if name in windows.covariances:
                yield _ellipse(header, name, track, path[row, -1], windows.covariances[name][row, -1], colour)


def _ellipse(
    header: Message, method: str, track: int, centre: np.ndarray, covariance: np.ndarray, colour: Colour
) -> Message:
    """A flat disc where a method expects somebody with `_REGION` at the end of its horizon."""
    variances, axes = np.linalg.eigh(covariance)
    length, width = 2.0 * np.sqrt(radius2(_REGION) * variances[::-1])
    half_yaw = 0.5 * np.arctan2(axes[1, 1], axes[0, 1])
    disc = _marker(
        header,
        namespaces(method)[1],
        track,
        _CYLINDER,
        {"x": length, "y": width, "z": _HEIGHT_M},
        colour,
        0.15,
    )
    turned = {"z": float(np.sin(half_yaw)), "w": float(np.cos(half_yaw))}
    return disc | {"pose": {"position": _point(centre), "orientation": turned}}


def _marker(
    header: Message, namespace: str, track: int, shape: int, scale: Message, colour: Colour, alpha: float
) -> Message:
    """What all markers have; the pose is the frame's own unless it is replaced."""
    return {
        "header": header,
        "ns": namespace,
        "id": int(np.int64(track).astype(np.int32)),  # markers count to 2^31 only: larger ids wrap
        "type": shape,
        "action": _ADD,
        "pose": {"orientation": {"w": 1.0}},
        "scale": scale,
        "color": dict(zip("rgba", (*colour, alpha), strict=True)),
    }


def _point(position: np.ndarray, height_m: float = 0.0) -> Message:
    return {"x": float(position[0]), "y": float(position[1]), "z": height_m}


def _stamp(time_ns: int) -> Message:
    return {"sec": time_ns // 10**9, "nanosec": time_ns % 10**9}


def _header(time_ns: int) -> Message:
    return {"stamp": _stamp(time_ns), "frame_id": FRAME}
