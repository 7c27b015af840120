"""Maps on disk as ROS `map_server` has them: a YAML file and the picture that it names.

image: map.pgm
resolution: 0.05               # side of a pixel, m
origin: [-3.0, -2.0, 0.0]      # pose of the lower left corner: x, y (m), yaw (rad)
negate: 0                      # 1: bright is occupied
occupied_thresh: 0.65
free_thresh: 0.25
"""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PureWindowsPath
from typing import Any

import numpy as np
import yaml
from PIL import Image

from pedpred.errors import InputError, brief
from pedpred.files import atomic_write, check_input, open_picture, read_yaml, translate_errors, write_text
from pedpred.scenes import OccupancyMap
from pedpred.scenes.turned_maps import turned_map
from pedpred.storage.pixels import MODES, blocked_cells, blocked_greys

_OCCUPIED, _FREE = 0, 254
_YAML = (".yaml", ".yml")
_PICTURES = (".pgm", ".ppm", ".png", ".bmp", ".jpg", ".jpeg", ".tif", ".tiff")
_TRUE, _FALSE = ("true", "yes", "on", "y", "1"), ("false", "no", "off", "n", "0")
_TWO_TURNS_RAD = 4.0 * math.pi
_REMEDY = "Correct the file or write it again"
_EXAMPLES = {
    "image": "map.pgm",
    "resolution": "0.05",
    "origin": "[0.0, 0.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.25",
}
_LONGEST_NAME = 100  # in a remedy
_ELSEWHERE = re.compile(r"/|~|[A-Za-z]:|[a-z0-9]+://")
"""How the paths of one machine or package begin."""
_log = logging.getLogger(__name__)


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
    about = _description_of(path)
    x, y, yaw_rad = about.pose()
    picture = about.picture()
    mode, greys = about.blocked_greys()
    with open_picture(picture, partial(InputError, picture, "file", remedy=_REMEDY)) as image:
        blocked = blocked_cells(image, greys, mode)
    side_m = about.number("resolution")
    with translate_errors(partial(InputError, about.path, "map", remedy=_REMEDY)):
        straight = OccupancyMap(blocked[::-1].T, np.array([x, y]), side_m)
        return turned_map(straight, yaw_rad) if yaw_rad else straight


@dataclass(frozen=True)
class _Description:
    """The YAML file of a map; its methods raise an `InputError` that names the field."""

    path: Path
    content: Mapping[str, Any]

    @classmethod
    def read(cls, path: Path) -> _Description:
        return cls(path, read_yaml(path, partial(InputError, path, "map", remedy=_REMEDY)))

    def error(self, key: str, problem: str, remedy: str = "Correct it") -> InputError:
        return InputError(self.path, key, problem, f"{remedy}, such as {key}: {_EXAMPLES[key]}")

    def field(self, key: str) -> Any:
        if key not in self.content:
            raise self.error(key, f"'{key}' is missing", "Add it")
        return self.content[key]

    def number(self, key: str, entry: int | None = None) -> float:
        """A field, or an entry of its list, as number; YAML takes 1e-2 for text."""
        value = self.field(key) if entry is None else self.field(key)[entry]
        try:
            if isinstance(value, bool):
                raise TypeError
            return float(value)
        except (TypeError, ValueError, OverflowError) as cause:
            raise self.error(key, f"{key} = {brief(value)} is not a number") from cause

    def pose(self) -> tuple[float, float, float]:
        """Of the outer corner at the lower left of the picture: x, y, m, and yaw, rad."""
        origin = self.field("origin")
        if not isinstance(origin, list) or len(origin) != 3:
            raise self.error("origin", f"{brief(origin)}, expected x, y and yaw")
        x, y, yaw_rad = (self.number("origin", entry) for entry in range(3))
        if not abs(yaw_rad) <= _TWO_TURNS_RAD:
            problem = f"yaw = {yaw_rad:g} rad, but it must be at most two turns: is it in degrees?"
            raise self.error("origin", problem, "Write metres and radians")
        return x, y, yaw_rad

    def blocked_greys(self) -> tuple[str, np.ndarray]:
        """The mode, and which greys are blocked. [256] bool; what the mode does not use may be missing."""
        mode = _word(self.content.get("mode", MODES[0]))
        if mode not in MODES:
            problem = f"mode = {brief(self.content['mode'])}, expected one of {', '.join(MODES)}"
            raise InputError(self.path, "mode", problem, f"Leave it out for {MODES[0]}")
        if mode == "raw":
            return mode, blocked_greys(mode, False, 1.0, 0.0)
        negate = _word(self.field("negate"))
        if negate not in (*_TRUE, *_FALSE):
            problem = f"negate = {brief(self.content['negate'])}, but it must be 0 or 1"
            raise self.error("negate", problem)
        has_free = mode == "scale" or "free_thresh" in self.content
        free_thresh = self._probability("free_thresh") if has_free else -1.0
        occupied_thresh = self._probability("occupied_thresh")
        if free_thresh > occupied_thresh:
            text = "%s: free_thresh %g is above occupied_thresh %g: cells between are free"
            _log.warning(text, self.path, free_thresh, occupied_thresh)
        return mode, blocked_greys(mode, negate in _TRUE, occupied_thresh, free_thresh)

    def _probability(self, key: str) -> float:
        value = self.number(key)
        if not 0.0 <= value <= 1.0:
            problem = f"{key} = {brief(self.content[key])}, but it must be a probability, from 0 to 1"
            raise self.error(key, problem)
        return value

    def picture(self) -> Path:
        r"""The picture; only the YAML file's folder is searched, and that of the file that it links to.

        A path of another machine (absolute, `~/`, `C:\`, `package://`) that is not in the folder stands for
        the file of that name beside the YAML file. A link counts as what it leads to.
        """
        image = self.field("image")
        if not isinstance(image, str) or not image.strip() or "\0" in image:
            raise self.error("image", f"{brief(image)} is no file name", "Name the picture")
        windows = PureWindowsPath(image)
        folders = {self.path.parent.resolve(), self.path.resolve().parent}
        places = [self.path.parent / image, self.path.parent.joinpath(*windows.parts)]
        if _ELSEWHERE.match(image):
            places.append(self.path.with_name(windows.name or self.path.name))
        for place in places:
            if _is_file_in(folders, place):
                return place
        is_name = 0 < len(windows.name) < _LONGEST_NAME and windows.name != ".."
        name = windows.name if is_name else _EXAMPLES["image"]
        problem = f"{brief(image)} is no file in the folder of {self.path.name}, and no other folder is read"
        remedy = f"Copy the picture to {name} beside {self.path.name}, and write image: {name}"
        raise InputError(self.path, "image", problem, remedy)


def _word(value: Any) -> str:
    """A short value as people write it, in lower case; other numbers than 0 and 1 are no words."""
    if value in (0, 1):
        return str(int(value))
    return value.lower() if isinstance(value, str) else ""


def _is_file_in(folders: set[Path], place: Path) -> bool:
    try:
        place = place.resolve()
        return any(place.is_relative_to(folder) for folder in folders) and place.is_file()
    except (OSError, RuntimeError):  # links in a circle, a name that is too long
        return False


def _description_of(path: Path) -> _Description:
    """Read the YAML file of a map that is named by its folder, by that file or by its picture."""
    if path.is_dir():
        return _in_folder(path)
    if path.suffix.lower() in _YAML:
        return _Description.read(path)
    for about in (path.with_suffix(".yaml"), path.with_suffix(".yml"), path.with_name("map.yaml")):
        if about.exists() and _names(described := _Description.read(about), path):
            return described
    if path.suffix.lower() not in _PICTURES:
        problem = f"files of type {path.suffix or 'unknown'} are not maps"
        kinds = f"a file {', '.join((*_YAML, *_PICTURES))}, or a geometry .xml, .wkt"
        raise InputError(path, "map", problem, f"Give a folder with map.yaml, {kinds}")
    problem = f"neither {path.stem}.yaml nor map.yaml beside it describes this picture"
    fields = ", ".join(f"{key}: {value}" for key, value in {**_EXAMPLES, "image": path.name}.items())
    raise InputError(path, "map", problem, f"Write one: {fields}")


def _in_folder(folder: Path) -> _Description:
    if (folder / "map.yaml").exists():
        return _Description.read(folder / "map.yaml")
    others = sorted(each.name for each in folder.iterdir() if each.suffix.lower() in _YAML)
    listed = f", only {brief(others)}" if others else ""
    remedy = f"Name the map itself: {folder / others[0]}" if others else "Name a folder that has one"
    raise InputError(folder, "map.yaml", f"there is no map.yaml in the folder{listed}", remedy)


def _names(about: _Description, picture: Path) -> bool:
    """Whether a YAML file describes a picture."""
    try:
        return about.picture().samefile(picture)
    except InputError:  # it describes another one, which is not here
        return False
