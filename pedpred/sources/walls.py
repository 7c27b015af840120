"""Walls and obstacles of a laboratory, from JuPedSim's geometry files to an `OccupancyMap`.

    <geometry unit="m"> <rooms> <room> <subroom>
        <polygon caption="wall"> <vertex px="0" py="0"/> ... </polygon>
        <obstacle> <polygon> <vertex px="2.1" py="2.3"/> ... </polygon> </obstacle>

A polygon in a subroom is the closed outline of the ground where people walk.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from xml.parsers import expat

import numpy as np

from pedpred.errors import SourceError, ValueRuleError, brief
from pedpred.files import read_bytes, translate_errors
from pedpred.scenes import OccupancyMap
from pedpred.storage.tables import UNITS
from pedpred.storage.text import numbers

_LARGEST_BYTES = 2**22
_MOST_CELLS = 2**24
_FARTHEST = 1e8  # surveyors' coordinates stay below
_BESIDE_M = 0.001  # how far from an open end it is asked which side of it is inside


@dataclass(frozen=True)
class Walls:
    """What a geometry file says; all polygons are closed, vertices [V, 2] in m.

    Attributes:
        outlines: ground where people walk.
        obstacles: in it.
    """

    outlines: tuple[np.ndarray, ...]
    obstacles: tuple[np.ndarray, ...]


@dataclass
class _Reading:
    """Handlers of the XML parser, and what they have read."""

    path: Path
    parser: expat.XMLParserType = field(default_factory=expat.ParserCreate)
    unit_m: float = 1.0
    within: list[str] = field(default_factory=list)
    polygons: dict[bool, list[list[list[float]]]] = field(default_factory=lambda: {False: [], True: []})
    in_subroom: int = 0

    def __post_init__(self) -> None:
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.StartDoctypeDeclHandler = self.refuse

    def error(self, problem: str) -> SourceError:
        return SourceError(self.path, self.parser.CurrentLineNumber, problem)

    def refuse(self, *_: object) -> None:
        raise self.error("a document type, which could define entities; geometry files have none")

    def start(self, name: str, attributes: Mapping[str, str]) -> None:
        if not self.within and name != "geometry":
            raise self.error(f"the outermost element is <{name}>, expected <geometry>")
        is_obstacle = "obstacle" in self.within
        if name == "geometry":
            if (unit := attributes.get("unit", "m")) not in UNITS:
                raise self.error(f"unit = {brief(unit)}, expected one of {', '.join(UNITS)}")
            self.unit_m = UNITS[unit]
        elif name == "subroom":
            self.in_subroom = 0
        elif name == "polygon":
            self.in_subroom += not is_obstacle
            if self.in_subroom > 1:
                raise self.error("a second outline in a subroom: draw one closed polygon, doors left open")
            self.polygons[is_obstacle].append([])
        elif name == "vertex" and "polygon" in self.within:
            given = [attributes.get(key, "") for key in ("px", "py")]
            point = numbers(self.path, self.parser.CurrentLineNumber, given, ("px", "py"))
            if max(map(abs, point)) > _FARTHEST:
                raise self.error(f"vertex {point}, farther than {_FARTHEST:g} from the origin")
            self.polygons[is_obstacle][-1].append([self.unit_m * value for value in point])
        self.within.append(name)

    def end(self, name: str) -> None:
        self.within.pop()
        if name == "polygon" and len(self.polygons["obstacle" in self.within][-1]) < 3:
            raise self.error("a polygon with fewer than 3 vertices")


def read_walls(path: Path) -> Walls:
    """Read a geometry file.

    Raises:
        SourceError: it is missing, large, no such XML or without an outline; it names line and value.
    """
    if not path.exists():
        raise SourceError(path, None, "the file is missing")
    reading = _Reading(path)
    with translate_errors(partial(SourceError, path, None)):
        reading.parser.Parse(read_bytes(path, _LARGEST_BYTES), True)
    outlines, obstacles = (tuple(map(np.array, reading.polygons[kind])) for kind in (False, True))
    if not outlines:
        raise SourceError(path, None, "no polygon outlines the ground where people walk")
    return Walls(outlines, obstacles)


def occupancy_of(
    walls: Walls,
    resolution_m: float,
    thickness_m: float,
    open_ends: Sequence[Sequence[Sequence[float]]] = (),
    open_end_m: float = 0.0,
) -> OccupancyMap:
    """Rasterise walls.

    A cell is free if its centre is inside an outline or beyond an open end, and in no obstacle. The map's
    origin is a multiple of the resolution. Ground outside the map is free, as everywhere.

    Args:
        walls: what the geometry file says.
        resolution_m: side of a cell, m.
        thickness_m: of the walls around the ground, m.
        open_ends: edges of the outline where the ground continues, world frame, m. [E, 2 ends, 2]
        open_end_m: how far it continues, in a corridor as wide as the edge, m.

    Raises:
        ValueRuleError: an open end does not lie on the outline, or the map would be absurdly large.
    """
    ends = [_beyond(walls, np.array(edge, dtype=np.float64), open_end_m) for edge in open_ends]
    around = [outline + side for outline in walls.outlines for side in (-thickness_m, thickness_m)]
    for a, b, c, d in ends:
        beside = thickness_m * (b - a) / np.linalg.norm(b - a)
        around.append(np.array([a - beside, b + beside, c + beside, d - beside]))
    corners = np.concatenate(around)
    first = np.floor(corners.min(axis=0) / resolution_m + 1e-6)
    shape = np.ceil(corners.max(axis=0) / resolution_m - 1e-6) - first
    if not shape.prod() <= _MOST_CELLS:
        size = (shape * resolution_m).round(1).tolist()
        raise ValueRuleError("map size [m]", size, f"it may have at most {_MOST_CELLS} cells")
    x, y = (resolution_m * (f + 0.5 + np.arange(int(n))) for f, n in zip(first, shape, strict=True))
    free = np.zeros(shape.astype(int), dtype=bool)
    for ground in (*walls.outlines, *ends):
        free |= _inside(ground, x, y)
    for obstacle in walls.obstacles:
        free &= ~_inside(obstacle, x, y)
    return OccupancyMap(~free, first * resolution_m, resolution_m)


def _beyond(walls: Walls, edge: np.ndarray, length_m: float) -> np.ndarray:
    """The corridor beyond an open end: its corners, from the ends of the edge outwards. [4, 2]."""
    along = edge[1] - edge[0]
    across = np.array([along[1], -along[0]]) / max(np.linalg.norm(along), np.finfo(float).tiny)
    probes = edge.mean(axis=0) + _BESIDE_M * np.array([across, -across])
    inner = [any(_inside(outline, p[:1], p[1:]).any() for outline in walls.outlines) for p in probes]
    if inner[0] == inner[1]:
        raise ValueRuleError("open_ends", edge.tolist(), "it must lie on the outline")
    outwards = length_m * (-across if inner[0] else across)
    return np.array([*edge, edge[1] + outwards, edge[0] + outwards])


def _inside(polygon: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Which points of a grid are in a closed polygon, by the even-odd rule.

    Args:
        polygon: vertices. [V, 2]
        x: coordinates of the grid's columns, rising. [X]
        y: of its rows, rising. [Y]

    Returns:
        [X, Y] bool
    """
    crossed = np.zeros((len(x) + 1, len(y)), dtype=bool)
    for (x_1, y_1), (x_2, y_2) in pairwise([*polygon, polygon[0]]):
        ends = np.searchsorted(y, (y_1, y_2))
        rows = np.arange(ends.min(), ends.max())
        at = x_1 + (y[rows] - y_1) * (x_2 - x_1) / (y_2 - y_1 or 1.0)
        crossed[np.searchsorted(x, at), rows] ^= True
    return np.logical_xor.accumulate(crossed, axis=0)[:-1]
