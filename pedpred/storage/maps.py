"""Maps on disk as ROS `map_server` has them: a YAML file and the picture that it names.

image: map.pgm
resolution: 0.05               # side of a pixel, m
origin: [-3.0, -2.0, 0.0]      # pose of the lower left corner: x, y (m), yaw (rad)
negate: 0                      # 1: bright is occupied
occupied_thresh: 0.65
free_thresh: 0.25
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path, PureWindowsPath
from typing import Annotated, Any

import numpy as np
import yaml
from PIL import Image

from pedpred.errors import InputError, ValueRuleError, brief
from pedpred.files import atomic_write, check_input, open_picture, read_yaml, translate_errors, write_text
from pedpred.scenes import OccupancyMap
from pedpred.scenes.turned_maps import turned_map
from pedpred.settings import In, OneOf, Settings, load
from pedpred.storage.pixels import MODES, blocked_cells, blocked_greys

_OCCUPIED, _FREE = 0, 254
_YAML = (".yaml", ".yml")
_TWO_TURNS_RAD = 4.0 * math.pi
_REMEDY = "Correct the file or write it again"
_EXAMPLES = {
    "image": "map.pgm",
    "resolution": "0.05",
    "origin": "[0.0, 0.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.25",
    "mode": MODES[0],
}


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


def read_map(path: Path) -> OccupancyMap:
    """Read a map as `nav2_map_server` does; cells above 50 are blocked, unknown ones are free.

    A yaw turns the map about its lower left corner; see `turned_map`.

    Args:
        path: a folder with map.yaml, a YAML file, or a picture beside a YAML file that names it.

    Raises:
        InputError: a file is missing, damaged or huge, or a field is missing or has another meaning.
    """
    check_input(path)
    described_in = _yaml_of(path)
    about = _read_description(described_in)
    picture = _find_picture(described_in, about.image)
    if not path.is_dir() and path != described_in and not picture.samefile(path):
        problem = f"{described_in.name} beside it describes another picture, {picture.name}"
        raise InputError(path, "map", problem, "Name the YAML file of the map")
    greys = blocked_greys(about.mode, bool(about.negate), about.occupied_thresh, about.free_thresh)
    with open_picture(picture, partial(InputError, picture, "file", remedy=_REMEDY)) as image:
        blocked = blocked_cells(image, greys, about.mode)
    *corner, yaw_rad = about.origin
    with translate_errors(partial(InputError, described_in, "map", remedy=_REMEDY)):
        straight = OccupancyMap(blocked[::-1].T, np.array(corner), about.resolution)
        return turned_map(straight, yaw_rad) if yaw_rad else straight


@dataclass(frozen=True)
class MapYaml(Settings):
    """The YAML file of a map."""

    image: str
    resolution: float
    origin: Annotated[tuple[float, ...], In("[-1e9, 1e9]")]
    negate: Annotated[float, In("[0, 1]")]
    occupied_thresh: Annotated[float, In("[0, 1]")]
    free_thresh: Annotated[float, In("[0, 1]")]
    mode: Annotated[str, OneOf(MODES)] = MODES[0]

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.origin) != 3 or not abs(self.origin[2]) <= _TWO_TURNS_RAD:
            raise ValueRuleError(
                "origin", self.origin, "it must be x and y, m, and yaw, rad, at most two turns"
            )


def _read_description(path: Path) -> MapYaml:
    """Read the YAML file of a map.

    Raises:
        InputError: a field is missing or has another meaning; it is named, with an example.
    """
    content = read_yaml(path, partial(InputError, path, "map", remedy=_REMEDY))
    known = {field.name for field in fields(MapYaml)} & content.keys()
    plain = {key: content[key] if key == "image" else _plain(content[key]) for key in known}
    try:
        return load(MapYaml, plain)
    except ValueRuleError as cause:
        key = cause.field.partition("[")[0]
        raise InputError(path, key, str(cause), f"Write a line such as {key}: {_EXAMPLES[key]}") from cause


def _plain(value: Any) -> Any:
    """A value as C++ reads it: numbers may be in quotes or, as 1e-2, without a point; words in any case."""
    if isinstance(value, list):
        return tuple(map(_plain, value))
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return value.lower() if isinstance(value, str) else value


def _find_picture(description: Path, image: str) -> Path:
    """Find the picture that a YAML file names, in its folder, below, or in that of the file that it links to.

    An absolute path that is not there stands for the file of that name beside the YAML file.

    Raises:
        InputError: there is none; a link counts as what it leads to.
    """
    folders = {description.parent.resolve(), description.resolve().parent}
    named = PureWindowsPath(image)  # with slashes of both kinds
    places = [description.parent / image, *([description.parent / named.name] if named.anchor else [])]
    for place in places:
        if _is_file_in(folders, place):
            return place
    problem = f"{brief(image)} is no file in the folder of {description.name}, and no other folder is read"
    raise InputError(description, "image", problem, f"Copy the picture beside {description.name}")


def _is_file_in(folders: set[Path], place: Path) -> bool:
    try:
        place = place.resolve()
        return any(place.is_relative_to(folder) for folder in folders) and place.is_file()
    except (OSError, RuntimeError, ValueError):  # links in a circle, a name that is too long or has a zero
        return False


def _yaml_of(path: Path) -> Path:
    """The YAML file of a map that is named by its folder, by that file or by its picture.

    Raises:
        InputError: there is none.
    """
    if path.is_dir():
        candidates = [path / "map.yaml"]
    elif path.suffix.lower() in _YAML:
        candidates = [path]
    else:
        candidates = [*map(path.with_suffix, _YAML), path.with_name("map.yaml")]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    problem = "no map: there is no map.yaml in the folder, or no YAML file beside the picture"
    lines = ", ".join(f"{key}: {value}" for key, value in _EXAMPLES.items())
    remedy = f"Name a YAML file or a geometry (.xml, .wkt). Lines of a YAML file: {lines}"
    raise InputError(path, "map", problem, remedy)
