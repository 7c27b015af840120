"""Ground and walls -> occupancy map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap

_MOST_CELLS = 2**24
_BESIDE_M = 0.001  # how far from an open end it is asked which side of it is inside
_MOST_LINE_CELLS = 2**21
_TOUCH = 1e-6  # a line this close to a cell, in cells, is in it
_DOOR_ASIDE_M = 0.01  # a door this far from a wall still lies in it
_MOST_CUTS = 100_000


@dataclass(frozen=True)
class Geometry:
    """What a geometry file says, world frame, m.

    Attributes:
        ground: polygons where people walk, with holes. Without any, all ground is.
        obstacles: polygons in it.
        lines: walls without thickness, from end to end. [S, 2, 2]
    """

    ground: tuple[shapely.Polygon, ...] = ()
    obstacles: tuple[shapely.Polygon, ...] = ()
    lines: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 2)))


def occupancy_of(
    walls: Geometry,
    resolution_m: float,
    thickness_m: float,
    open_ends: Sequence[Sequence[Sequence[float]]] = (),
    open_end_m: float = 0.0,
) -> OccupancyMap:
    """Rasterise walls.

    A cell is free if its centre is on the ground or beyond an open end, and in no obstacle, and if no line
    touches it. The map's origin is a multiple of the resolution. Ground outside the map is free, as
    everywhere.

    Args:
        walls: what the geometry file says.
        resolution_m: side of a cell, m.
        thickness_m: of the walls around the ground, m; without ground, free ground around the lines.
        open_ends: edges of the outline where the ground continues, world frame, m; parts of lines that are
            open. [E, 2 ends, 2]
        open_end_m: how far it continues, in a corridor as wide as the edge, m.

    Raises:
        ValueRuleError: an open end does not lie on the outline or on a line, or the map would be absurdly
            large.
    """
    edges, lines = np.array(open_ends, dtype=np.float64).reshape(-1, 2, 2), walls.lines
    ends = [_beyond(walls, edge, open_end_m) for edge in edges] if walls.ground else []
    if not walls.ground:
        lines = cut_doors(lines, edges, needed=True)
    shells = [np.array(polygon.exterior.coords) for polygon in walls.ground or walls.obstacles]
    shells += [walls.lines.reshape(-1, 2)] if len(walls.lines) else []
    around = [shell + side for shell in shells for side in (-thickness_m, thickness_m)]
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
    free = np.full(shape.astype(int), not walls.ground)
    for polygon in (*walls.ground, *map(shapely.Polygon, ends)):
        _fill(free, polygon, x, y, True)
    for polygon in walls.obstacles:
        _fill(free, polygon, x, y, False)
    _block_lines(free, lines / resolution_m - first)
    return OccupancyMap(~free, first * resolution_m, resolution_m)


def _fill(free: np.ndarray, polygon: shapely.Polygon, x: np.ndarray, y: np.ndarray, value: bool) -> None:
    """Set the cells whose centres lie in a polygon, where an odd number of its turns encloses them."""
    polygon = shapely.make_valid(polygon)
    shapely.prepare(polygon)
    left, low, right, high = polygon.bounds
    columns = slice(np.searchsorted(x, left), np.searchsorted(x, right, "right"))
    rows = slice(np.searchsorted(y, low), np.searchsorted(y, high, "right"))
    inside = shapely.contains_xy(polygon, x[columns, None], y[None, rows])
    free[columns, rows][inside] = value


def _beyond(walls: Geometry, edge: np.ndarray, length_m: float) -> np.ndarray:
    """The corridor beyond an open end: its corners, from the ends of the edge outwards. [4, 2]."""
    along = edge[1] - edge[0]
    across = np.array([along[1], -along[0]]) / max(np.linalg.norm(along), np.finfo(float).tiny)
    probes = edge.mean(axis=0) + _BESIDE_M * np.array([across, -across])
    inner = [any(shapely.contains_xy(polygon, *probe) for polygon in walls.ground) for probe in probes]
    if inner[0] == inner[1]:
        raise ValueRuleError("open_ends", edge.tolist(), "it must lie on the outline")
    outwards = length_m * (-across if inner[0] else across)
    return np.array([*edge, edge[1] + outwards, edge[0] + outwards])


def _block_lines(free: np.ndarray, lines: np.ndarray) -> None:
    """Block every cell that a line touches, so that a wall has no hole at a corner of a cell.

    A line between two cells blocks both.

    Args:
        free: changed in place. [X, Y]
        lines: in cells, from the outer corner of cell (0, 0). [S, 2, 2]

    Raises:
        ValueRuleError: the lines would touch an absurd number of cells.
    """
    cells = np.abs(np.diff(lines, axis=1)).sum()
    if not cells <= _MOST_LINE_CELLS:
        raise ValueRuleError(
            "walls [cells]", float(cells), f"they may be at most {_MOST_LINE_CELLS} cells long"
        )
    around = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2)
    for start, end in lines:
        points = np.linspace(start, end, 2 + int(np.abs(end - start).max()))
        near = np.unique((np.floor(points)[:, None] + around).reshape(-1, 2).astype(int), axis=0)
        near = near[((near >= 0) & (near < free.shape)).all(axis=-1)]
        boxes = shapely.box(*near.T, *(near.T + 1))
        touched = near[shapely.dwithin(boxes, shapely.LineString([start, end]), _TOUCH)]
        free[tuple(touched.T)] = False


def cut_doors(lines: np.ndarray, doors: np.ndarray, needed: bool = False) -> np.ndarray:
    """Open walls where doors lie in them; a door in a gap changes nothing.

    Args:
        lines: walls, from end to end, m. [S, 2, 2]
        doors: likewise. [D, 2, 2]
        needed: each door must open a wall.

    Returns:
        What is left of the walls. [S', 2, 2]

    Raises:
        ValueRuleError: a door that is needed opens no wall, or there are absurdly many doors in walls.
    """
    if not len(doors):
        return lines
    left, cuts = shapely.linestrings(lines), 0
    tree = shapely.STRtree(left)
    openings = shapely.buffer(shapely.linestrings(doors), _DOOR_ASIDE_M, cap_style="flat")
    for door, opening in zip(doors, openings, strict=True):
        along = tree.query(opening, predicate="intersects") if not opening.is_empty else np.zeros(0, int)
        if (cuts := cuts + len(along)) > _MOST_CUTS:
            raise ValueRuleError("doors", len(doors), f"they may lie in at most {_MOST_CUTS} walls")
        shorter = shapely.difference(left[along], opening)
        if needed and not (shapely.length(shorter) < shapely.length(left[along]) - 2 * _DOOR_ASIDE_M).any():
            raise ValueRuleError("open_ends", door.tolist(), "it must lie on a wall")
        left[along] = shorter
    points, piece = shapely.get_coordinates(shapely.get_parts(left), return_index=True)
    same = piece[1:] == piece[:-1]
    return np.stack([points[:-1][same], points[1:][same]], axis=1)
