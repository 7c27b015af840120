"""Maps as users name them: a folder, a YAML file of `map_server`, its picture, or a geometry."""

from __future__ import annotations

import logging
from functools import partial
from pathlib import Path
from typing import Any

from pedpred.command.turned_maps import read_turned_map, yaw_of
from pedpred.errors import InputError, brief
from pedpred.files import check_input, read_yaml
from pedpred.reading.geometry import GEOMETRIES, is_geometry, read_ground, read_walls
from pedpred.scenes import OccupancyMap
from pedpred.storage.maps import picture_of, read_map_file

_YAML = (".yaml", ".yml")
_PICTURES = (".pgm", ".ppm", ".png", ".bmp", ".jpg", ".jpeg", ".tif", ".tiff")
_REMEDY = "Correct the file"
_log = logging.getLogger(__name__)


def map_at(path: Path) -> OccupancyMap:
    """Read a map; unknown cells count as free, and a yaw turns the map about its lower left corner.

    Args:
        path: a folder with map.yaml, a YAML file of any name, the picture that one beside it names, or a
            geometry, whose outline is closed.

    Raises:
        InputError: a file is missing or damaged, or no YAML file names the picture.
        InputError: a geometry is damaged.
    """
    check_input(path)
    if is_geometry(path):
        return read_ground(path, read_walls(path))
    named = _in_folder(path) if path.is_dir() else path
    about = named if named.suffix.lower() in _YAML else _describing(named)
    content = read_yaml(about, partial(InputError, about, "map", remedy=_REMEDY))
    _doubt_thresholds(about, content)
    if yaw_rad := yaw_of(about, content):
        return read_turned_map(about, content, yaw_rad, _REMEDY)
    return read_map_file(about, _REMEDY)


def _in_folder(folder: Path) -> Path:
    """The map.yaml of a folder, which must be there."""
    if not (folder / "map.yaml").exists():
        others = sorted(each.name for each in folder.iterdir() if each.suffix.lower() in _YAML)
        remedy = (
            f"Name the map itself: --map {folder / others[0]}" if others else "Name a folder that has one"
        )
        listed = f", only {brief(others)}" if others else ""
        raise InputError(folder, "map.yaml", f"there is no map.yaml in the folder{listed}", remedy)
    return folder / "map.yaml"


def _doubt_thresholds(about: Path, content: dict[str, Any]) -> None:
    """Warn about thresholds that look exchanged; nav2_map_server takes what is free and occupied for free."""
    free, occupied = (content.get(key) for key in ("free_thresh", "occupied_thresh"))
    if isinstance(free, int | float) and isinstance(occupied, int | float) and free > occupied:
        text = "%s: free_thresh %g is above occupied_thresh %g: cells between are free; are they exchanged?"
        _log.warning(text, about, free, occupied)


def _describing(picture: Path) -> Path:
    """Find the YAML file beside a picture that names it."""
    for about in (picture.with_suffix(".yaml"), picture.with_suffix(".yml"), picture.with_name("map.yaml")):
        wording = partial(InputError, about, "map", remedy=_REMEDY)
        if about.exists() and _names(about, read_yaml(about, wording), picture):
            return about
    if picture.suffix.lower() not in _PICTURES:
        known = f"a folder with map.yaml, a file {', '.join((*_YAML, *_PICTURES))}, "
        known += f"or a geometry {', '.join(GEOMETRIES)}"
        problem = f"files of type {picture.suffix or 'unknown'} are not read"
        raise InputError(picture, "map", problem, f"Give {known}")
    problem = f"neither {picture.stem}.yaml nor map.yaml beside it describes this picture"
    remedy = f"Write one: image: {picture.name}, resolution: 0.05, origin: [0, 0, 0], negate: 0, "
    raise InputError(picture, "map", problem, f"{remedy}occupied_thresh: 0.65, free_thresh: 0.2")


def _names(about: Path, content: dict[str, Any], picture: Path) -> bool:
    """Whether a YAML file describes a picture."""
    try:
        return picture_of(about, content).samefile(picture)
    except InputError:  # it describes another one, which is not here
        return False
