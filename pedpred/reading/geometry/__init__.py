"""Ground, walls and doors from geometry files, and maps of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from pedpred.errors import InputError
from pedpred.files import translate_errors
from pedpred.reading.errors import add_path
from pedpred.reading.geometry.raster import Geometry, occupancy_of
from pedpred.reading.geometry.wkt import parse_wkt, read_wkt
from pedpred.reading.geometry.xml import read_xml
from pedpred.scenes import OccupancyMap

CELL_M, WALL_M, _OPEN_END_M = 0.05, 3.0, 6.0
"""Of maps made from geometries, m: side of a cell, thickness of walls, length of what is beyond open ends."""
GEOMETRIES: dict[str, Callable[[Path], Geometry]] = {".xml": read_xml, ".wkt": read_wkt}
_WRONG = 'Correct the file or the open ends. Lengths are metres, in XML also cm with unit="cm"'


def is_geometry(path: Path) -> bool:
    """Whether a name is that of a geometry file."""
    return path.suffix.lower() in GEOMETRIES


def read_walls(path: Path) -> Geometry:
    """Read a geometry file.

    Raises:
        InputError: it is of no kind that is read, or its reader refuses it.
    """
    if not is_geometry(path):
        problem = f"files of type {path.suffix or 'unknown'} are not read"
        raise InputError(path, None, problem, f"Give a file {', '.join(GEOMETRIES)}")
    with add_path(path):
        return GEOMETRIES[path.suffix.lower()](path)


def read_ground(
    path: Path, walls: Geometry, open_ends: Sequence[Sequence[Sequence[float]]] = ()
) -> OccupancyMap:
    """Draw the walls of a file as a map.

    Args:
        path: of the file, for errors.
        walls: what it says.
        open_ends: see `occupancy_of`.

    Raises:
        InputError: they make no map, or an open end does not lie on them.
    """
    with translate_errors(partial(InputError, path, None, remedy=_WRONG)):
        return occupancy_of(walls, CELL_M, WALL_M, open_ends, _OPEN_END_M)


__all__ = ["GEOMETRIES", "Geometry", "is_geometry", "occupancy_of", "parse_wkt", "read_ground", "read_walls"]
