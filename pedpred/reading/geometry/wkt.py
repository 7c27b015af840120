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
_BETWEEN = " \t\r\n;,"
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
        with np.errstate(all="ignore"):
            parts = [part for one in _split(text) for part in _parts(shapely.from_wkt(one))]
    except (shapely.GEOSException, ValueError) as cause:
        raise ContentError(f"{type(cause).__name__}: {cause}"[:300], _REMEDY) from cause
    if not parts:
        raise ContentError("the geometry is empty", _REMEDY)
    if not (np.abs(shapely.get_coordinates(parts)) <= _FARTHEST_M).all():
        problem = f"a coordinate is not a number or farther than {_FARTHEST_M:g} from the origin"
        raise ContentError(problem, _REMEDY)
    ground = [_without_holes(part) for part in parts if isinstance(part, shapely.Polygon)]
    lines = [shapely.get_coordinates(part) for part in parts if not isinstance(part, shapely.Polygon)]
    segments = [np.stack([line[:-1], line[1:]], axis=1) for line in lines]
    polygons = [part for part in shapely.get_parts(ground) if isinstance(part, shapely.Polygon)]
    return Geometry(tuple(polygons), (), np.concatenate([np.zeros((0, 2, 2)), *segments]))


def _split(text: str) -> Iterator[str]:
    """Divide geometries that follow each other; brackets are counted first, since GEOS does not."""
    depth, start = 0, 0
    for at, sign in enumerate(text):
        depth += (sign == "(") - (sign == ")")
        if depth > _DEEPEST:
            raise ValueError(f"brackets more than {_DEEPEST} deep")
        if sign == ")" and depth == 0:
            yield _strip(text[start : at + 1])
            start = at + 1
    if rest := _strip(text[start:]):
        yield rest


def _strip(text: str) -> str:
    text = text.strip(_BETWEEN)
    return text.partition(";")[2] if text.upper().startswith("SRID=") else text


def _parts(geometry: shapely.Geometry) -> Iterator[shapely.Geometry]:
    """Polygons and lines that a geometry consists of."""
    if isinstance(geometry, shapely.Polygon | shapely.LineString):
        if not geometry.is_empty:
            yield geometry
    elif isinstance(geometry, shapely.GeometryCollection | shapely.MultiPolygon | shapely.MultiLineString):
        for part in geometry.geoms:
            yield from _parts(part)
    else:
        raise ValueError(f"a {geometry.geom_type}, which is neither ground nor a wall")


def _without_holes(polygon: shapely.Polygon) -> shapely.Geometry:
    """The ground of a polygon, also where holes overlap each other or its outline."""
    if polygon.is_valid:
        return shapely.force_2d(polygon)
    holes = [shapely.make_valid(shapely.Polygon(ring)) for ring in polygon.interiors]
    ground = shapely.make_valid(shapely.Polygon(polygon.exterior))
    return shapely.difference(ground, shapely.union_all(holes))
