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

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely

from pedpred.errors import brief
from pedpred.files import read_bytes
from pedpred.reading.errors import ContentError
from pedpred.reading.geometry.raster import Geometry, cut_doors
from pedpred.reading.options import UNITS
from pedpred.reading.text import to_number
from pedpred.reading.xml_parser import XmlParser

_LARGEST_BYTES = 2**22
_FARTHEST = 1e8  # surveyors' coordinates stay below
_DOORS = ("crossing", "transition")
_REMEDY = "Give the geometry file; a project or trajectory file of JuPedSim names it"

Polygon = list[list[float]]


def read_xml(path: Path) -> Geometry:
    """Read a geometry file.

    Raises:
        ContentError: it is large, no such XML or without walls; it names the line.
    """
    reading = _Reading()
    reading.parser.feed(read_bytes(path, _LARGEST_BYTES), final=True)
    subrooms = [polygons for polygons in reading.subrooms if polygons]
    if not subrooms:
        problem = "no polygon outlines the ground where people walk, and no wall is drawn"
        raise ContentError(problem, "Add a <polygon> with <vertex> to a <subroom>")
    obstacles: list[shapely.Polygon] = []
    edges: list[Polygon] = []
    for polygons in filter(None, reading.obstacles):
        filled, left = _filled(polygons)
        obstacles += filled
        edges += left
    if all(len(polygons) == 1 and len(polygons[0]) > 2 for polygons in subrooms) and not reading.doors:
        ground = tuple(shapely.Polygon(polygons[0]) for polygons in subrooms)
        return Geometry(ground, tuple(obstacles), _segments(edges))
    walls = _segments([polygon for polygons in subrooms for polygon in polygons])
    lines = cut_doors(walls, _segments(reading.doors))
    return Geometry((), tuple(obstacles), np.concatenate([lines, _segments(edges)]))


class _Reading:
    """Handlers of the XML parser, and what they have read."""

    def __init__(self) -> None:
        self.parser = XmlParser("geometry", self.start, self.end, _REMEDY)
        self.unit_m = 1.0
        self.within: list[str] = []
        self.subrooms: list[list[Polygon]] = []
        self.obstacles: list[list[Polygon]] = []
        self.doors: list[Polygon] = []
        self.drawn: Polygon | None = None

    def start(self, name: str, attributes: Mapping[str, str]) -> None:
        if name == "geometry":
            unit = attributes.get("unit", "m").strip().lower()
            if unit not in UNITS:
                raise self.parser.problem(f"unit = {brief(unit)}, expected one of {', '.join(UNITS)}")
            self.unit_m = UNITS[unit]
        elif name == "subroom":
            self.subrooms.append([])
        elif name == "obstacle":
            self.obstacles.append([])
        elif name in ("polygon", *_DOORS) and "goal" not in self.within:
            self.drawn = self.new(name)
        elif name == "vertex" and self.drawn is not None:
            self.drawn.append(self.vertex(attributes))
        self.within.append(name)

    def new(self, name: str) -> Polygon:
        """Begin a polygon or a door."""
        drawn: Polygon = []
        if name in _DOORS:
            self.doors.append(drawn)
            return drawn
        if "obstacle" not in self.within and not self.subrooms:
            self.subrooms.append([])  # a room without subrooms
        (self.obstacles if "obstacle" in self.within else self.subrooms)[-1].append(drawn)
        return drawn

    def vertex(self, attributes: Mapping[str, str]) -> list[float]:
        point = []
        for key in ("px", "py"):
            text = attributes.get(key, "")
            try:
                point.append(to_number(text))
            except ValueError as cause:
                raise self.parser.problem(f"{key} = {brief(text)} is not a number") from cause
        if not all(abs(value) <= _FARTHEST for value in point):
            raise self.parser.problem(f"vertex {point}, farther than {_FARTHEST:g} from the origin")
        return [self.unit_m * value for value in point]

    def end(self, name: str) -> None:
        self.within.pop()
        if name in ("polygon", *_DOORS) and self.drawn is not None:
            if len(self.drawn) < 2:
                raise self.parser.problem(
                    f"a {name} with fewer than 2 vertices", "Remove it, or add its other end"
                )
            self.drawn = None


def _filled(polygons: Sequence[Polygon]) -> tuple[list[shapely.Polygon], list[Polygon]]:
    """The closed polygons of an obstacle, and those of its edges that enclose nothing."""
    closed = [shapely.Polygon(polygon) for polygon in polygons if _is_closed(polygon)]
    edges = [polygon for polygon in polygons if not _is_closed(polygon)]
    filled, *others = shapely.polygonize_full(shapely.linestrings(_segments(edges)))
    left = [line.coords for kind in others for line in kind.geoms]
    if left and all(len(polygon) > 2 for polygon in edges):  # closed without saying so
        return [*closed, *map(shapely.Polygon, edges)], []
    return [*closed, *filled.geoms], [[list(point) for point in line] for line in left]


def _is_closed(polygon: Polygon) -> bool:
    return len(polygon) > 3 and polygon[0] == polygon[-1]


def _segments(polygons: Sequence[Polygon]) -> np.ndarray:
    """Every edge from vertex to vertex. [S, 2, 2]."""
    edges = [edge for polygon in polygons for edge in pairwise(polygon)]
    return np.array(edges, dtype=np.float64).reshape(-1, 2, 2)
