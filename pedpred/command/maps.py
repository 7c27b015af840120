"""Maps as users name them: a folder, a YAML file of `map_server`, or its picture."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from pedpred.command.turned_maps import read_turned_map, yaw_of
from pedpred.errors import StorageError
from pedpred.files import read_yaml
from pedpred.scenes import OccupancyMap
from pedpred.sources.geometries import GEOMETRIES
from pedpred.storage.maps import picture_of, read_map_file

_YAML = (".yaml", ".yml")
_PICTURES = (".pgm", ".ppm", ".png", ".bmp", ".jpg", ".jpeg")
_REMEDY = "Correct the file"


def map_at(path: Path) -> OccupancyMap:
    """Read a map; unknown cells count as free, and a yaw turns the map about its lower left corner.

    Args:
        path: a folder with map.yaml, a YAML file of any name, or the picture that one beside it names.

    Raises:
        StorageError: a file is missing or damaged, or no YAML file names the picture.
    """
    named = path / "map.yaml" if path.is_dir() else path
    about = named if named.suffix.lower() in _YAML else _describing(named)
    content = read_yaml(about, partial(StorageError, about, "map", remedy=_REMEDY))
    if yaw_rad := yaw_of(about, content):
        return read_turned_map(about, content, yaw_rad, _REMEDY)
    return read_map_file(about, _REMEDY)


def _describing(picture: Path) -> Path:
    """Find the YAML file beside a picture that names it."""
    for about in (picture.with_suffix(".yaml"), picture.with_suffix(".yml"), picture.with_name("map.yaml")):
        wording = partial(StorageError, about, "map", remedy=_REMEDY)
        if about.exists() and _names(about, read_yaml(about, wording), picture):
            return about
    if picture.suffix.lower() not in _PICTURES:
        known = f"a folder with map.yaml, a file {', '.join((*_YAML, *_PICTURES))}, "
        known += f"or a geometry {', '.join(GEOMETRIES)}"
        problem = f"files of type {picture.suffix or 'unknown'} are not read"
        raise StorageError(picture, "map", problem, f"Give {known}")
    problem = f"neither {picture.stem}.yaml nor map.yaml beside it describes this picture"
    remedy = f"Write one: image: {picture.name}, resolution: 0.05, origin: [0, 0, 0], negate: 0, "
    raise StorageError(picture, "map", problem, f"{remedy}occupied_thresh: 0.65, free_thresh: 0.2")


def _names(about: Path, content: dict[str, Any], picture: Path) -> bool:
    """Whether a YAML file describes a picture."""
    try:
        return picture_of(about, content).samefile(picture)
    except StorageError:  # it describes another one, which is not here
        return False
