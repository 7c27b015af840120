"""Geometries as well-known text (OGC 06-103r4): the ground where people walk, with holes for obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.sources.walls import Walls

_MOST_CHARACTERS, _DEEPEST = 2**22, 8
_FARTHEST_M = 1e8
_REMEDY = "It needs POLYGON, MULTIPOLYGON or a GEOMETRYCOLLECTION of them"


def walls_of_wkt(path: Path, texts: Sequence[str]) -> Walls:
    """Read polygons; where there are several, people may walk in each.

    Args:
        path: the file that has them, for errors.
        texts: geometries in m.

    Raises:
        SourceError: one is damaged, has no area or more than polygons.
    """
    for text in texts:
        _check_nesting(path, text)
    with translate_errors(partial(SourceError, path, None, remedy=_REMEDY)):
        ground: Any = shapely.union_all([shapely.from_wkt(text) for text in texts])
        polygons = [part for part in getattr(ground, "geoms", [ground]) if part.geom_type == "Polygon"]
        if not polygons or len(polygons) < len(getattr(ground, "geoms", [ground])) or ground.is_empty:
            raise SourceError(path, None, f"the geometry is {ground.geom_type}, no ground", _REMEDY)
        rings = [[np.array(ring.coords)[:-1, :2] for ring in (p.exterior, *p.interiors)] for p in polygons]
    corners = np.concatenate([corner for ring in rings for corner in ring])
    if not (np.abs(corners) <= _FARTHEST_M).all():
        raise SourceError(path, None, f"a corner is farther than {_FARTHEST_M:g} m from the origin", _REMEDY)
    return Walls(tuple(own[0] for own in rings), tuple(hole for own in rings for hole in own[1:]))


def _check_nesting(path: Path, text: str) -> None:
    """Check size and depth, since the library's parser recurses without a bound."""
    depth = longest = 0
    for part in text[: _MOST_CHARACTERS + 1].split("(")[1:]:
        depth += 1 - part.count(")")
        longest = max(longest, depth + part.count(")"))
    if len(text) > _MOST_CHARACTERS or longest > _DEEPEST:
        raise SourceError(path, None, f"a geometry of {len(text)} characters, {longest} deep", _REMEDY)
