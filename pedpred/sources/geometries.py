"""Kinds of geometry files, by what their names end in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.scenes import OccupancyMap
from pedpred.sources.geometry_wkt import read_wkt
from pedpred.sources.geometry_xml import read_xml
from pedpred.sources.walls import Walls, occupancy_of

CELL_M, WALL_M, _OPEN_END_M = 0.05, 3.0, 6.0
"""Of maps made from geometries, m: side of a cell, thickness of walls, length of what is beyond open ends."""

_WRONG = 'Correct the file or the open ends. Lengths are metres, in XML also cm with unit="cm"'
GEOMETRIES: dict[str, Callable[[Path], Walls]] = {".xml": read_xml, ".wkt": read_wkt}


def is_geometry(path: Path) -> bool:
    """Whether a name is that of a geometry file."""
    return path.suffix.lower() in GEOMETRIES


def read_walls(path: Path) -> Walls:
    """Read a geometry file.

    Raises:
        SourceError: it is of no kind that is read, or its reader refuses it.
    """
    if not is_geometry(path):
        problem = f"files of type {path.suffix or 'unknown'} are not read"
        raise SourceError(path, None, problem, f"Give a file {', '.join(GEOMETRIES)}")
    return GEOMETRIES[path.suffix.lower()](path)


def read_ground(
    path: Path, walls: Walls, open_ends: Sequence[Sequence[Sequence[float]]] = ()
) -> OccupancyMap:
    """Draw the walls of a file as a map.

    Args:
        path: of the file, for errors.
        walls: what it says.
        open_ends: see `occupancy_of`.

    Raises:
        SourceError: they make no map, or an open end does not lie on them.
    """
    with translate_errors(partial(SourceError, path, None, remedy=_WRONG)):
        return occupancy_of(walls, CELL_M, WALL_M, open_ends, _OPEN_END_M)
