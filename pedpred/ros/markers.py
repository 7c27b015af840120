"""People and forecasts as visualization_msgs markers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pedpred.geometry import rotate
from pedpred.metrics.calibration import radius2
from pedpred.ros.message_types import known_types
from pedpred.ros.scene_messages import Content, header, point
from pedpred.scenes import Forecast, Predictions

if TYPE_CHECKING:  # the node draws forecasts without the libraries that read files
    from pedpred.evaluation.forecasts import EvaluationWindows

Colour = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""

_POINT = "geometry_msgs/msg/Point"
_ADD, _DELETE_ALL = 0, 3
_ARROW, _CYLINDER, _LINE_STRIP, _TEXT = 0, 3, 4, 9
_PERSON_M = {"x": 0.4, "y": 0.4, "z": 1.7}
_ARROW_M = {"x": 0.05, "y": 0.12, "z": 0.15}
"""Shaft diameter, head diameter, head length."""
_LINE_M, _TEXT_M = 0.05, 0.3
_HEIGHT_M = 0.02
"""Height of paths above the map, so that viewers draw them over it."""
_ARROW_S = 0.75
"""A velocity arrow ends where the person would be after this time."""
_REGION = 0.9
"""Share of the probability inside an error ellipse."""
_UNTURNED: Content = {"orientation": {"w": 1.0}}
_INK: Colour = (0.13, 0.13, 0.13)


def namespaces(method: str) -> tuple[str, str, str]:
    """The namespaces of a method's markers: point forecasts, error ellipses, modes."""
    return method, f"{method} ellipse", f"{method} modes"


def markers_message(
    people: Mapping[str, list[Any]],
    windows: EvaluationWindows | None,
    rows: np.ndarray,
    colours: Mapping[str, Colour],
    time_ns: int,
) -> Content:
    """visualization_msgs/MarkerArray: people, the tracked velocity, the true path and forecasts.

    Args:
        people: columns of `tracks_table` at this instant, drawn as cylinders.
        windows: forecasts of the scene, or None.
        rows: its windows at this instant. [n] int
        colours: of each method to be drawn; its name is the markers' namespace.
        time_ns: the instant.
    """
    markers: list[Content] = []
    for track, x, y in zip(people["track_id"], people["x_m"], people["y_m"], strict=True):
        pose = _UNTURNED | {"position": {"x": x, "y": y, "z": _PERSON_M["z"] / 2}}
        markers.append(_marker("people", track, _CYLINDER, _PERSON_M, _INK, 0.6, pose=pose))
    if windows is not None:
        velocity = rotate(windows.velocity[rows], windows.heading_rad[rows])
        forecasts = {method: windows.predictions[method].select(rows) for method in colours}
        for index, row in enumerate(rows):
            track, start = windows.track_id[row], windows.position[row]
            ends = [point(start), point(start + _ARROW_S * velocity[index])]
            markers.append(_marker("velocity", track, _ARROW, _ARROW_M, _INK, 1.0, points=ends))
            markers.append(_line("truth", track, start, windows.truth[row], _INK, 1.0))
            for method, colour in colours.items():
                markers += _forecast_markers(method, forecasts[method], index, track, start, colour)
    return _picture(markers, header(time_ns))


def forecast_message(
    forecast: Forecast, names: Sequence[str], colour: Colour, time_ns: int, frame: str
) -> Content:
    """visualization_msgs/MarkerArray: all paths of a forecast, and the names of people above their heads.

    Numbers of markers are rows: they have 32 bits, in which tracks of 64 bits may be the same.
    """
    markers: list[Content] = []
    start = forecast.position[:, 0] - forecast.dt_s * forecast.velocity[:, 0]
    for row, position in enumerate(start):
        markers += _forecast_markers("pedpred", forecast.predictions, row, row, position, colour)
    for row, (name, position) in enumerate(zip(names, start, strict=True)):
        pose = {"position": point(position, _PERSON_M["z"]), **_UNTURNED}
        markers.append(_marker("names", row, _TEXT, {"z": _TEXT_M}, _INK, 1.0, text=name, pose=pose))
    return _picture(markers, header(time_ns, frame))


def _picture(markers: Iterable[Content], here: Content) -> Content:
    """A complete picture, which replaces the one before."""
    clearing = {"action": _DELETE_ALL, "pose": _UNTURNED}
    return {"markers": [{"header": here} | marker for marker in (clearing, *markers)]}


def _forecast_markers(
    method: str, forecasts: Predictions, row: int, number: int, start: np.ndarray, colour: Colour
) -> Iterator[Content]:
    """The point forecast as a line, its error ellipse, and several modes as lines, their weight as alpha."""
    _, ellipse, modes = namespaces(method)
    yield _line(method, number, start, forecasts.point[row], colour, 1.0)
    if forecasts.covariance is not None:
        centre, covariance = forecasts.most_likely[row, -1], forecasts.covariance[row, 0, -1]
        yield _disc(ellipse, number, centre, covariance, colour)
    if forecasts.modes > 1:
        for mode, (path, weight) in enumerate(zip(forecasts.path[row], forecasts.weight[row], strict=True)):
            yield _line(modes, row * forecasts.modes + mode, start, path, colour, float(weight))


def _line(
    namespace: str, number: int, start: np.ndarray, path: np.ndarray, colour: Colour, alpha: float
) -> Content:
    make = known_types().types[_POINT]  # thousands, so not by way of dictionaries
    points = [make(x, y, _HEIGHT_M) for x, y in np.vstack([start, path]).tolist()]
    return _marker(namespace, number, _LINE_STRIP, {"x": _LINE_M}, colour, alpha, points=points)


def _disc(namespace: str, number: int, centre: np.ndarray, covariance: np.ndarray, colour: Colour) -> Content:
    """A flat ellipse that holds `_REGION` of the probability at the end of the horizon."""
    variances, axes = np.linalg.eigh(covariance)
    length, width = 2.0 * np.sqrt(radius2(_REGION) * variances[::-1])
    half_yaw = 0.5 * np.arctan2(axes[1, 1], axes[0, 1])
    size = {"x": length, "y": width, "z": _HEIGHT_M}
    turned = {"z": float(np.sin(half_yaw)), "w": float(np.cos(half_yaw))}
    pose = {"position": point(centre), "orientation": turned}
    return _marker(namespace, number, _CYLINDER, size, colour, 0.15, pose=pose)


def _marker(
    namespace: str, number: int, shape: int, scale: Content, colour: Colour, alpha: float, **more: Any
) -> Content:
    """A marker; its pose is that of the frame, unless `more` fields hold another one."""
    return {
        "ns": namespace,
        "id": int(np.int64(number).astype(np.int32)),  # 32 bits: larger track ids wrap
        "type": shape,
        "action": _ADD,
        "pose": _UNTURNED,
        "scale": scale,
        "color": dict(zip("rgba", (*colour, alpha), strict=True)),
    } | more
