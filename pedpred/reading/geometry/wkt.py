"""Ground and walls from well-known text (WKT), as JuPedSim and PedPy have them.

    POLYGON ((0 0, 10 0, 10 4, 0 4, 0 0), (4 1, 5 1, 5 2, 4 2, 4 1))

Polygons are the ground where people walk, with holes where obstacles stand; line strings are walls.
Coordinates are metres.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import shapely

from pedpred.files import read_bytes
from pedpred.reading.errors import ContentError
from pedpred.reading.geometry.raster import Geometry
from pedpred.reading.head import UTF_16

_FARTHEST_M = 1e8  # surveyors' coordinates stay below
_LARGEST_BYTES = 2**22
_DEEPEST = 16  # brackets; GEOS parses each level within the one before
_REMEDY = "Write the ground as POLYGON, MULTIPOLYGON or a GEOMETRYCOLLECTION of these, walls as LINESTRING"


def read_wkt(path: Path) -> Geometry:
    """Read a file with one geometry, or several in a row."""
    raw = read_bytes(path, _LARGEST_BYTES)
    text = raw.decode("utf-16" if raw.startswith(UTF_16) else "utf-8-sig")
    lines = (line for line in text.splitlines() if not line.lstrip().startswith("#"))
    return parse_wkt("\n".join(lines).strip().strip("\"'"))


def parse_wkt(text: str) -> Geometry:
    """Build one geometry, or several in a row: people may walk in each of them.

    Raises:
        ContentError: it is large, no WKT, or has neither ground nor walls.
    """
    if len(text) > _LARGEST_BYTES:
        raise ContentError(f"a geometry of {len(text)} characters, at most {_LARGEST_BYTES} are read")
    try:
        parts = [part for one in _geometries(text) for part in _parts(one)]
    except (shapely.GEOSException, ValueError) as cause:
        raise ContentError(f"{type(cause).__name__}: {cause}"[:300], _REMEDY) from cause
    if not (np.abs(shapely.get_coordinates(parts)) <= _FARTHEST_M).all():
        problem = f"a coordinate is not a number or farther than {_FARTHEST_M:g} from the origin"
        raise ContentError(problem, _REMEDY)
    polygons = [part for part in parts if isinstance(part, shapely.Polygon)]
    lines = [np.array(part.coords)[:, :2] for part in parts if not isinstance(part, shapely.Polygon)]
    if not parts:
        raise ContentError("the geometry is empty", _REMEDY)
    segments = [np.stack([line[:-1], line[1:]], axis=1) for line in lines]
    ground = tuple(sound for polygon in polygons for sound in _sound(polygon))
    return Geometry(ground, (), np.concatenate([np.zeros((0, 2, 2)), *segments]))


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


def _sound(polygon: shapely.Polygon) -> Iterator[shapely.Polygon]:
    """The ground of a polygon without its holes, also where holes overlap each other or its outline."""
    if polygon.is_valid:
        yield shapely.force_2d(polygon)
        return
    holes = shapely.make_valid([shapely.Polygon(ring) for ring in polygon.interiors])
    ground = shapely.make_valid(shapely.Polygon(polygon.exterior)).difference(shapely.union_all(holes))
    yield from (each for each in shapely.get_parts(ground) if isinstance(each, shapely.Polygon))
