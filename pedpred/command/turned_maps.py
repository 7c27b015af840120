"""Maps of `map_server` whose origin has a yaw: turned about their lower left corner, as in navigation."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import InputError
from pedpred.files import open_picture, translate_errors
from pedpred.ros.frames import TWO_TURNS_RAD
from pedpred.scenes import OccupancyMap
from pedpred.scenes.turned_maps import turned_map

# The parts of a file that mean the same in a map that is not turned.
from pedpred.storage.maps import _field, _meaning, _number, picture_of
from pedpred.storage.pixels import blocked_cells, blocked_greys

_POSE = 3
_ORIGIN = "Write x, y and yaw in metres and radians: origin: [0.0, 0.0, 0.0]"


def yaw_of(path: Path, content: dict[str, Any]) -> float:
    """The angle by which a map is turned, counter-clockwise, rad; 0 where there is no such origin.

    Args:
        path: the YAML file, for errors.
        content: of it.

    Raises:
        InputError: it is not finite, or more than two turns, as in degrees.
    """
    origin = content.get("origin")
    if not isinstance(origin, list) or len(origin) != _POSE:
        return 0.0
    yaw_rad = _number(path, "origin", origin[2])
    if not math.isfinite(yaw_rad):
        raise InputError(path, "origin", f"yaw = {yaw_rad}, but it must be finite", _ORIGIN)
    if abs(yaw_rad) > TWO_TURNS_RAD:
        problem = f"yaw = {yaw_rad:g} rad is more than two turns: is it in degrees?"
        raise InputError(path, "origin", problem, _ORIGIN)
    return yaw_rad


def read_turned_map(path: Path, content: dict[str, Any], yaw_rad: float, remedy: str) -> OccupancyMap:
    """Read a turned map as the smallest one along the axes that holds it; unknown cells count as free.

    Args:
        path: the YAML file.
        content: of it.
        yaw_rad: the angle, see `yaw_of`.
        remedy: of errors.

    Raises:
        InputError: a file is missing or damaged, or a field is missing or has another meaning.
    """
    x, y = (_number(path, "origin", value) for value in content["origin"][:2])
    side_m = _number(path, "resolution", _field(path, content, "resolution"))
    mode, negate, occupied_thresh, free_thresh = _meaning(path, content)
    picture = picture_of(path, content)
    with open_picture(picture, partial(InputError, picture, "file", remedy=remedy)) as image:
        blocked = blocked_cells(image, blocked_greys(mode, negate, occupied_thresh, free_thresh), mode)
    with translate_errors(partial(InputError, path, "map", remedy=remedy)):
        straight = OccupancyMap(blocked[::-1].T, np.array([x, y]), side_m)
        return turned_map(straight, yaw_rad)
