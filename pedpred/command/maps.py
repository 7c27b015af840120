"""Maps as users name them: a folder, a YAML file of `map_server`, or its picture."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from pedpred.errors import StorageError
from pedpred.files import Wording, read_picture, read_yaml, translate_errors
from pedpred.scenes import OccupancyMap, blocked_greys
from pedpred.storage.scenes import read_map

_YAML = (".yaml", ".yml")


def map_at(path: Path) -> OccupancyMap:
    """Read a map; unknown cells count as free.

    Args:
        path: a folder with map.yaml, a YAML file of any name, or the picture that one beside it names.

    Raises:
        StorageError: a file is missing or damaged, or no YAML file names the picture.
    """
    if path.is_dir():
        return read_map(path)
    about = path if path.suffix in _YAML else _describing(path)
    plain = read_yaml(about, _wording(about))
    with translate_errors(_wording(about)):
        x, y, yaw = plain["origin"]
        if yaw:
            raise StorageError(about, "origin", f"yaw is {yaw} rad", "Only maps with yaw 0 are understood")
        if Path(plain["image"]).name != plain["image"]:
            raise StorageError(about, "image", f"{plain['image']!r}", "Put the picture beside the file")
        picture = about.with_name(plain["image"])
        grey = read_picture(picture, "L", _wording(picture))
        occupied = blocked_greys(plain["negate"], plain["occupied_thresh"])[grey]
        return OccupancyMap(occupied[::-1].T, np.array([x, y]), float(plain["resolution"]))


def _describing(picture: Path) -> Path:
    """Find the YAML file beside a picture that names it."""
    for about in (picture.with_suffix(".yaml"), picture.with_suffix(".yml"), picture.with_name("map.yaml")):
        if about.exists() and read_yaml(about, _wording(about)).get("image") == picture.name:
            return about
    problem = f"neither {picture.stem}.yaml nor map.yaml beside it describes this picture"
    remedy = f"Write one: image: {picture.name}, resolution: 0.05, origin: [0, 0, 0], negate: 0, "
    raise StorageError(picture, "map", problem, f"{remedy}occupied_thresh: 0.65, free_thresh: 0.2")


def _wording(path: Path) -> Wording:
    return partial(StorageError, path, "map", remedy="Correct the file")
