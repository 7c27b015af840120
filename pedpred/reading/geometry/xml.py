"""Walls, doors and obstacles from JuPedSim's geometry files.

    <geometry unit="m"> <rooms> <room>
        <subroom>
            <polygon caption="wall"> <vertex px="0" py="0"/> ... </polygon>
            <obstacle> <polygon> <vertex px="2.1" py="2.3"/> ... </polygon> </obstacle>
        </subroom>
        <crossings> <crossing> <vertex px="4" py="0"/> <vertex px="4" py="1"/> </crossing> </crossings>
    </room> </rooms> <transitions> <transition> ... </transition> </transitions>

If each subroom has one polygon and there are no doors, polygons are closed outlines of the ground where
people walk. Otherwise polygons are walls without thickness, from vertex to vertex, open where a door
(crossing or transition) lies in them. An obstacle is one polygon, or several that are its edges.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import shapely

from pedpred.errors import brief
from pedpred.files import read_bytes
from pedpred.reading.errors import NO_DOCTYPE, ContentError
from pedpred.reading.geometry.raster import Geometry, cut_doors
from pedpred.reading.options import UNITS
from pedpred.reading.text import finite_number

_LARGEST_BYTES = 2**22
_FARTHEST = 1e8  # surveyors' coordinates stay below

Polygon = list[tuple[float, float]]


def read_xml(path: Path) -> Geometry:
    """Read a geometry file.

    Raises:
        ContentError: it is large, no such XML or without walls.
    """
    root = _parse(read_bytes(path, _LARGEST_BYTES))
    subrooms = [
        _polygons(one.findall("polygon"), root) for one in (*root.iter("subroom"), *root.iter("room"))
    ]
    subrooms = [polygons for polygons in subrooms if polygons]
    obstacles = [_polygons(obstacle.iter("polygon"), root) for obstacle in root.iter("obstacle")]
    doors = _polygons((*root.iter("crossing"), *root.iter("transition")), root)
    if not subrooms:
        problem = "no polygon outlines the ground where people walk, and no wall is drawn"
        raise ContentError(problem, "Add a <polygon> with <vertex> to a <subroom>")
    filled, edges = _fill_obstacles(obstacles)
    if all(len(polygons) == 1 and len(polygons[0]) > 2 for polygons in subrooms) and not doors:
        ground = tuple(shapely.Polygon(polygons[0]) for polygons in subrooms)
        return Geometry(ground, filled, _segments(edges))
    walls = _segments([polygon for polygons in subrooms for polygon in polygons])
    return Geometry((), filled, np.concatenate([cut_doors(walls, _segments(doors)), _segments(edges)]))


class _Builder(ElementTree.TreeBuilder):
    def doctype(self, *_: object) -> None:
        raise ContentError(*NO_DOCTYPE)


def _parse(raw: bytes) -> ElementTree.Element:
    """Parse a geometry file; the unit of lengths is a key of `UNITS`."""
    parser = ElementTree.XMLParser(target=_Builder())  # noqa: S314 (no document type, so no entities)
    parser.feed(raw)
    root = parser.close()
    if root.tag != "geometry":
        problem = f"the outermost element is <{str(root.tag)[:80]}>, expected <geometry>"
        raise ContentError(
            problem, "Give the geometry file; a project or trajectory file of JuPedSim names it"
        )
    unit = root.get("unit", "m").strip().lower()
    if unit not in UNITS:
        raise ContentError(f"unit = {brief(unit)}, expected one of {', '.join(UNITS)}")
    root.set("unit", unit)
    return root


def _polygons(elements: Iterable[ElementTree.Element], root: ElementTree.Element) -> list[Polygon]:
    """The vertices of elements, m.

    Raises:
        ContentError: an element has fewer than two, or one is no place.
    """
    unit_m, polygons = UNITS[root.get("unit", "m")], []
    for element in elements:
        polygon = []
        for vertex in element.iter("vertex"):
            texts = [vertex.get(key, "") for key in ("px", "py")]
            try:
                x, y = map(finite_number, texts)
            except ValueError as cause:
                raise ContentError(f"vertex {brief(texts)} of a {element.tag}: {cause}") from cause
            if max(abs(x), abs(y)) > _FARTHEST:
                raise ContentError(f"vertex {brief(texts)}, farther than {_FARTHEST:g} from the origin")
            polygon.append((unit_m * x, unit_m * y))
        if len(polygon) < 2:
            problem = f"a {element.tag} with fewer than 2 vertices"
            raise ContentError(problem, "Remove it, or add its other end")
        polygons.append(polygon)
    return polygons


def _fill_obstacles(
    obstacles: Sequence[Sequence[Polygon]],
) -> tuple[tuple[shapely.Polygon, ...], list[Polygon]]:
    """The polygons of obstacles, and those of their edges that enclose nothing."""
    filled: list[shapely.Polygon] = []
    left: list[Polygon] = []
    for polygons in obstacles:
        edges = [polygon for polygon in polygons if len(polygon) < 4 or polygon[0] != polygon[-1]]
        filled += [shapely.Polygon(polygon) for polygon in polygons if polygon not in edges]
        rings, *others = shapely.polygonize_full(shapely.linestrings(_segments(edges)))
        open_lines = [list(line.coords) for kind in others for line in kind.geoms]
        if open_lines and all(len(polygon) > 2 for polygon in edges):  # closed without saying so
            filled += map(shapely.Polygon, edges)
        else:
            filled += rings.geoms
            left += open_lines
    return tuple(filled), left


def _segments(polygons: Sequence[Polygon]) -> np.ndarray:
    """Every edge from vertex to vertex. [S, 2, 2]."""
    edges = [edge for polygon in polygons for edge in pairwise(polygon)]
    return np.array(edges, dtype=np.float64).reshape(-1, 2, 2)
