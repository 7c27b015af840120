"""Ground and walls from well-known text (WKT), as JuPedSim and PedPy have them.

    POLYGON ((0 0, 10 0, 10 4, 0 4, 0 0), (4 1, 5 1, 5 2, 4 2, 4 1))

Polygons are the ground where people walk, with holes where obstacles stand; line strings are walls.
Coordinates are metres.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import shapely

from pedpred.errors import SourceError
from pedpred.files import read_bytes, translate_errors
from pedpred.sources.walls import Walls
from pedpred.tables.encodings import UTF_16

FARTHEST_M = 1e8  # surveyors' coordinates stay below
LARGEST_BYTES = 2**22
_log = logging.getLogger(__name__)
_DEEPEST = 16  # brackets; GEOS parses each level within the one before
_REMEDY = "Write the ground as POLYGON, MULTIPOLYGON or a GEOMETRYCOLLECTION of these, walls as LINESTRING"


def read_wkt(path: Path) -> Walls:
    """Read a file with one geometry, or several in a row.

    Raises:
        SourceError: it is missing, large, no WKT, or has neither ground nor walls.
    """
    if not path.exists():
        raise SourceError(path, None, "the file is missing")
    with translate_errors(partial(SourceError, path, None, remedy=_REMEDY)):
        raw = read_bytes(path, LARGEST_BYTES)
        text = raw.decode("utf-16" if raw.startswith(UTF_16) else "utf-8-sig")
        lines = (line for line in text.splitlines() if not line.lstrip().startswith("#"))
        return parse_wkt(path, "\n".join(lines).strip().strip("\"'"))


def parse_wkt(path: Path, text: str) -> Walls:
    """Build the walls of one geometry, or several in a row: people may walk in each of them.

    Raises:
        SourceError: it is large, no WKT, or has neither ground nor walls; the path is that of the file.
    """
    wording = partial(SourceError, path, None, remedy=_REMEDY)
    if len(text) > LARGEST_BYTES:
        raise wording(f"a geometry of {len(text)} characters, at most {LARGEST_BYTES} are read")
    with translate_errors(wording):
        parts = [part for one in _geometries(text) for part in _parts(one)]
        if not (np.abs(shapely.get_coordinates(parts)) <= FARTHEST_M).all():
            raise ValueError(f"a coordinate is not a number or farther than {FARTHEST_M:g} from the origin")
        parts = [sound for part in parts for sound in _sound(path, part)]
    outlines = tuple(
        tuple(np.array(ring.coords)[:-1, :2] for ring in (part.exterior, *part.interiors))
        for part in parts
        if isinstance(part, shapely.Polygon)
    )
    lines = [np.array(part.coords)[:, :2] for part in parts if not isinstance(part, shapely.Polygon)]
    if not outlines and not lines:
        raise wording("the geometry is empty")
    segments = [np.stack([line[:-1], line[1:]], axis=1) for line in lines]
    return Walls(outlines, (), np.concatenate([np.zeros((0, 2, 2)), *segments]))


def _geometries(text: str) -> Iterator[shapely.Geometry]:
    """Parse geometries that follow each other; brackets are counted first, since GEOS does not."""
    depth, start = 0, 0
    for at, sign in enumerate(text):
        depth += (sign == "(") - (sign == ")")
        if depth > _DEEPEST:
            raise ValueError(f"brackets more than {_DEEPEST} deep")
        if sign == ")" and depth == 0:
            yield _parsed(text[start : at + 1])
            start = at + 1
    if rest := text[start:].strip(" \t\r\n;,"):
        yield _parsed(rest)


def _parsed(text: str) -> shapely.Geometry:
    text = text.strip(" \t\r\n;,")
    if text.upper().startswith("SRID="):
        text = text.partition(";")[2]
    with np.errstate(all="ignore"):
        return shapely.from_wkt(text)


def _parts(geometry: shapely.Geometry) -> Iterator[shapely.Geometry]:
    """Polygons and lines that a geometry consists of."""
    if isinstance(geometry, shapely.Polygon | shapely.LineString):
        if not geometry.is_empty:
            yield geometry
    elif hasattr(geometry, "geoms") and not isinstance(geometry, shapely.MultiPoint):
        for part in geometry.geoms:
            yield from _parts(part)
    else:
        raise ValueError(f"a {geometry.geom_type}, which is neither ground nor a wall")


def _sound(path: Path, part: shapely.Geometry) -> Iterator[shapely.Geometry]:
    """The ground of a polygon without its holes, also where holes overlap each other or its outline."""
    if not isinstance(part, shapely.Polygon) or part.is_valid:
        yield part
        return
    if not shapely.is_valid(outline := shapely.Polygon(part.exterior)):
        text = "%s: an outline is odd (%s): ground is what an odd number of its turns encloses"
        _log.warning(text, path, shapely.is_valid_reason(outline))
    holes = shapely.make_valid([shapely.Polygon(ring) for ring in part.interiors])
    ground = shapely.make_valid(outline).difference(shapely.union_all(holes))
    yield from (each for each in shapely.get_parts(ground) if isinstance(each, shapely.Polygon))
