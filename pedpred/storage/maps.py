"""Maps on disk: the pair of ROS `map_server`, a YAML file and a picture."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path, PureWindowsPath
from typing import Any

import numpy as np
import yaml
from PIL import Image

from pedpred.errors import InputError, brief
from pedpred.files import atomic_write, open_picture, read_yaml, translate_errors, write_text
from pedpred.scenes import OccupancyMap
from pedpred.storage.pixels import MODES, blocked_cells, blocked_greys

_OCCUPIED, _FREE = 0, 254
_REMEDY = "Correct the file or write the scene again"
_TRUE, _FALSE = ("true", "yes", "on", "y", "1"), ("false", "no", "off", "n", "0")
_USUAL = {
    "image": "map.pgm",
    "resolution": "0.05",
    "origin": "[0.0, 0.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.25",
}
_LONGEST_NAME = 100  # in a remedy
_ELSEWHERE = re.compile(r"/|~|[A-Za-z]:|[a-z0-9]+://")  # how the paths of one machine or package begin


def write_map(occupancy: OccupancyMap, folder: Path) -> None:
    """Write the ROS map_server pair `map.yaml` + `map.pgm` (row 0 is the largest y)."""
    grey = np.where(occupancy.occupied.T[::-1], _OCCUPIED, _FREE).astype(np.uint8)
    with atomic_write(folder / "map.pgm") as new:
        Image.fromarray(grey).save(new)
    about = {
        "image": "map.pgm",
        "resolution": float(occupancy.resolution_m),
        "origin": [float(occupancy.origin[0]), float(occupancy.origin[1]), 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    write_text(folder / "map.yaml", yaml.safe_dump(about, sort_keys=False))


def read_map(folder: Path) -> OccupancyMap:
    """Read `map.yaml` of a folder; see `read_map_file`."""
    return read_map_file(folder / "map.yaml")


def read_map_file(path: Path, remedy: str = _REMEDY) -> OccupancyMap:
    """Read a map as `nav2_map_server` does; cells above 50 are blocked, unknown ones are free.

    Args:
        path: the YAML file; its picture is what `picture_of` finds.
        remedy: of errors.

    Raises:
        InputError: a file is missing or damaged, a field is missing or has another meaning, the map is
            rotated, or its picture is huge or lies elsewhere.
    """
    wording = partial(InputError, path, "map", remedy=remedy)
    about = read_yaml(path, wording)
    x, y = _origin(path, about)
    picture = picture_of(path, about)
    mode, negate, occupied_thresh, free_thresh = _meaning(path, about)
    with open_picture(picture, partial(InputError, picture, "file", remedy=remedy)) as image:
        occupied = blocked_cells(image, blocked_greys(mode, negate, occupied_thresh, free_thresh), mode)
    resolution_m = _number(path, "resolution", _field(path, about, "resolution"))
    with translate_errors(wording):
        return OccupancyMap(occupied[::-1].T, np.array([x, y]), resolution_m)


def picture_of(path: Path, about: dict[str, Any]) -> Path:
    r"""Find the picture that a YAML file names; only the YAML file's folder is searched.

    A path of another machine (absolute, `~/`, `C:\`, `package://`) that is not in the folder stands for the
    file of that name beside the YAML file. A link counts as what it leads to.

    Args:
        path: the YAML file. If it is a link, the folder that it leads to counts too.
        about: its content.

    Raises:
        InputError: there is no such picture, or it is outside.
    """
    image = _field(path, about, "image")
    if not isinstance(image, str) or not image.strip() or "\0" in image:
        problem = f"{brief(image)} is no file name"
        raise InputError(path, "image", problem, f"Name the picture: image: {_USUAL['image']}")
    windows = PureWindowsPath(image)
    folders = {path.parent.resolve(), path.resolve().parent}
    places = [path.parent / image, path.parent.joinpath(*windows.parts)]
    if _ELSEWHERE.match(image):
        places.append(path.with_name(windows.name or path.name))
    for place in places:
        if _is_picture_in(folders, place):
            return place
    name = windows.name if 0 < len(windows.name) < _LONGEST_NAME and windows.name != ".." else _USUAL["image"]
    problem = f"{brief(image)} is no file in the folder of {path.name}, and no other folder is read"
    remedy = f"Copy the picture to {name} beside {path.name}"
    raise InputError(path, "image", problem, f"{remedy}, and write image: {name}")


def _is_picture_in(folders: set[Path], place: Path) -> bool:
    try:
        place = place.resolve()
        return any(place.is_relative_to(folder) for folder in folders) and place.is_file()
    except (OSError, RuntimeError):  # links in a circle, a name that is too long
        return False


def _field(path: Path, about: dict[str, Any], key: str) -> Any:
    if key not in about:
        raise InputError(path, key, f"'{key}' is missing", f"Add it, such as {key}: {_USUAL[key]}")
    return about[key]


def _number(path: Path, key: str, value: Any) -> float:
    """A number, also one in quotes or with an exponent that YAML takes for text (1e-2)."""
    try:
        if isinstance(value, bool):
            raise TypeError
        return float(value)
    except (TypeError, ValueError, OverflowError) as cause:
        problem = f"{key} = {brief(value)} is not a number"
        raise InputError(path, key, problem, f"Write a number, such as {key}: {_USUAL[key]}") from cause


def _origin(path: Path, about: dict[str, Any]) -> tuple[float, float]:
    """World position of the outer corner at the lower left of the picture, m."""
    origin, remedy = _field(path, about, "origin"), f"Write x, y and yaw: origin: {_USUAL['origin']}"
    if not isinstance(origin, list) or len(origin) != 3:
        raise InputError(path, "origin", f"{brief(origin)}, expected three numbers", remedy)
    x, y, yaw = (_number(path, "origin", value) for value in origin)
    if yaw:
        raise InputError(path, "origin", f"yaw is {brief(yaw)} rad", "Only maps with yaw 0 are understood")
    return x, y


def _meaning(path: Path, about: dict[str, Any]) -> tuple[str, bool, float, float]:
    """How greys are understood: mode, negate and thresholds; what the mode does not use may be missing."""
    mode = _word(about.get("mode", MODES[0]))
    if mode not in MODES:
        problem = f"mode = {brief(about['mode'])}, expected one of {', '.join(MODES)}"
        raise InputError(path, "mode", problem, "Correct it, or leave it out for trinary")
    if mode == "raw":
        return mode, False, 1.0, 0.0
    negate = _word(_field(path, about, "negate"))
    if negate not in (*_TRUE, *_FALSE):
        problem = f"negate = {brief(about['negate'])}, but it must be 0 or 1"
        raise InputError(path, "negate", problem, "Write negate: 0 where dark is blocked, else 1")
    free_thresh = (
        _probability(path, about, "free_thresh") if mode == "scale" or "free_thresh" in about else -1.0
    )
    return mode, negate in _TRUE, _probability(path, about, "occupied_thresh"), free_thresh


def _word(value: Any) -> str:
    """A short value as people write it, in lower case; anything else is no word."""
    if isinstance(value, int) and value in (0, 1):  # or true and false
        return str(int(value))
    return value.lower() if isinstance(value, str) else ""


def _probability(path: Path, about: dict[str, Any], key: str) -> float:
    value = _number(path, key, _field(path, about, key))
    if not 0 <= value <= 1:
        problem = f"{key} = {brief(about[key])}, but it must be a probability, a number from 0 to 1"
        raise InputError(path, key, problem, "Divide percentages by 100")
    return value
