"""Random obstacles for the clutter generator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pedpred.settings import Range
from pedpred.simulation.shapes import Circle, Polygon, Rectangle, Shape

Rng = np.random.Generator
Part = tuple[float, float, float, float]  # x0, y0, x1, y1 of an upright part of the room, m

_DOOR_MARGIN_M = 0.4  # wall between a door and the end of the wall
_OFF_WALL_M = 1.3  # free strip between columns and the outer walls


def split_walls(
    part: Part, doors_m: Sequence[float], thickness_m: float, smallest_m: float, rng: Rng
) -> tuple[list[Shape], list[Part]] | None:
    """Split a part of the room by a wall with doors, mostly across its longer side.

    Returns:
        The pieces of the wall and the two new parts; None if the part is too small.
    """
    sides = np.array([part[2] - part[0], part[3] - part[1]])
    axis = int(np.argmax(sides * rng.uniform(0.7, 1.3, 2)))
    if sides[axis] < 2 * smallest_m:
        axis = 1 - axis
    if sides[axis] < 2 * smallest_m:
        return None
    at = float(rng.uniform(part[axis] + smallest_m, part[axis + 2] - smallest_m))
    low, high = part[1 - axis], part[3 - axis]
    pieces = []
    for start, end in _between_doors(low, high, doors_m, rng):
        center, size = [0.0, 0.0], [0.0, 0.0]
        center[axis], center[1 - axis] = at, 0.5 * (start + end)
        size[axis], size[1 - axis] = thickness_m, end - start
        pieces.append(_rectangle(center, size, 0.0))
    x0, y0, x1, y1 = part
    if axis == 0:
        return pieces, [(x0, y0, at, y1), (at, y0, x1, y1)]
    return pieces, [(x0, y0, x1, at), (x0, at, x1, y1)]


def _between_doors(low: float, high: float, doors_m: Sequence[float], rng: Rng) -> list[tuple[float, float]]:
    """The pieces of a wall from `low` to `high` between doors at random places."""
    share = (high - low) / len(doors_m)
    ends = [low]
    for index, door in enumerate(doors_m):
        door = min(door, share - 2 * _DOOR_MARGIN_M)
        spare = max(share - door - 2 * _DOOR_MARGIN_M, 0.0)
        start = low + index * share + _DOOR_MARGIN_M + spare * rng.random()
        ends += [start, start + door]
    ends.append(high)
    return list(zip(ends[::2], ends[1::2], strict=True))


def columns(size_m: Sequence[float], radius_m: float, spacing_m: float, rng: Rng) -> list[Shape]:
    """Make a regular grid of round or square columns."""
    axes = []
    for side in size_m:
        count = max(1, int((side - 2 * _OFF_WALL_M) / spacing_m) + 1)
        margin = 0.5 * (side - (count - 1) * spacing_m)
        axes.append(margin + spacing_m * np.arange(count))
    places = [[float(x), float(y)] for x in axes[0] for y in axes[1]]
    if rng.random() < 0.5:
        return [Circle(place, float(radius_m)) for place in places]
    angle = float(rng.choice([0.0, 45.0]))
    return [_rectangle(place, [1.8 * radius_m] * 2, angle) for place in places]


_SIDES_M: dict[str, tuple[Range, ...]] = {
    "table": ((1.2, 2.2), (0.7, 1.1)),
    "crate": ((0.5, 1.2),),
    "block": ((1.5, 3.2), (1.5, 3.2)),
    "screen": ((1.5, 4.0),),
}
"""Length and depth of rectangular pieces; with one range, a crate is square and a screen thin."""
_SCREEN_M = 0.25
_ROUND_TABLE_M = (0.35, 0.9)  # radius
_ISLAND_M = (0.5, 1.4)  # distance of a corner from the middle
_CABINET_M = ((0.8, 2.6), (0.4, 0.7))  # length and depth
KINDS = (*_SIDES_M, "round_table", "island", "cabinet")


def furniture(
    size_m: Sequence[float], shares: np.ndarray, turned_share: float, scale: float, rng: Rng
) -> Shape:
    """Make a random piece of furniture at a random place.

    Args:
        size_m: sides of the room. [2]
        shares: probability of each kind. [len(KINDS)]
        turned_share: probability of an arbitrary angle.
        scale: factor on its size.
        rng: source of all randomness.
    """
    kind = KINDS[rng.choice(len(KINDS), p=shares)]
    turned = rng.random() < turned_share
    angle = float(rng.uniform(0.0, 180.0)) if turned else float(rng.choice([0.0, 90.0]))
    center = [float(rng.uniform(0.3, side - 0.3)) for side in size_m]
    if kind == "round_table":
        return Circle(center, float(scale * rng.uniform(*_ROUND_TABLE_M)))
    if kind == "island":
        return _island(center, angle, scale, rng)
    if kind == "cabinet":
        return _cabinet(center, size_m, scale, rng)
    sides = [scale * rng.uniform(*limits) for limits in _SIDES_M[kind]]
    return _rectangle(center, (sides[0], _SCREEN_M if kind == "screen" else sides[-1]), angle)


def _rectangle(center: Sequence[float], size: Sequence[float], angle_deg: float) -> Shape:
    return Rectangle([float(c) for c in center], [float(s) for s in size], angle_deg)


def _island(center: list[float], angle: float, scale: float, rng: Rng) -> Shape:
    """An irregular polygon: a flower bed, a stall."""
    turns = np.deg2rad(angle) + 2 * np.pi * (np.arange(6) + rng.uniform(-0.3, 0.3, 6)) / 6
    radii = scale * rng.uniform(*_ISLAND_M, 6)
    corners = np.array(center) + radii[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    return Polygon(corners.tolist())


def _cabinet(center: list[float], room_m: Sequence[float], scale: float, rng: Rng) -> Shape:
    """A shelf along one of the outer walls."""
    length, depth = scale * rng.uniform(*_CABINET_M[0]), rng.uniform(*_CABINET_M[1])
    axis, far = int(rng.integers(2)), rng.integers(2)
    place, size = list(center), [0.0, 0.0]
    place[axis] = room_m[axis] - depth / 2 if far else depth / 2
    size[axis], size[1 - axis] = depth, length
    return _rectangle(place, size, 0.0)
