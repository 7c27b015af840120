"""Obstacle shapes, as point-membership tests. Metres and degrees, world frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.geometry import rotate
from pedpred.settings import finite, load, positive

Point = Sequence[float]


class Shape(Protocol):
    """Interface of every shape."""

    def covers(self, points: np.ndarray) -> np.ndarray:
        """Whether points (m, [..., 2]) lie inside the shape. [...] bool."""
        ...

    def bounds(self) -> np.ndarray:
        """Lower left and upper right corner of an axis-aligned box around the shape, m. [2, 2]."""
        ...


@dataclass(frozen=True)
class Rectangle:
    """A rectangle rotated counter-clockwise about its centre."""

    center: Point
    size_m: Point
    angle_deg: float = 0.0

    def __post_init__(self) -> None:
        finite("center", self.center, (2,))
        positive("size_m", self.size_m, (2,))
        finite("angle_deg", self.angle_deg)

    def covers(self, points: np.ndarray) -> np.ndarray:
        """See `Shape`."""
        local = np.abs(rotate(points - np.asarray(self.center), -np.deg2rad(self.angle_deg)))
        width, depth = self.size_m
        return (local[..., 0] <= 0.5 * width) & (local[..., 1] <= 0.5 * depth)

    def bounds(self) -> np.ndarray:
        """See `Shape`."""
        width, depth = self.size_m
        return _box([self.center], 0.5 * float(np.hypot(width, depth)))


@dataclass(frozen=True)
class Circle:
    """A disc."""

    center: Point
    radius_m: float

    def __post_init__(self) -> None:
        finite("center", self.center, (2,))
        positive("radius_m", self.radius_m)

    def covers(self, points: np.ndarray) -> np.ndarray:
        """See `Shape`."""
        return np.linalg.norm(points - np.asarray(self.center), axis=-1) <= self.radius_m

    def bounds(self) -> np.ndarray:
        """See `Shape`."""
        return _box([self.center], self.radius_m)


@dataclass(frozen=True)
class Polygon:
    """A simple polygon given by its corners in order, [K, 2]."""

    corners: Sequence[Point]

    def __post_init__(self) -> None:
        import shapely  # late: most rooms have no polygon

        corners = finite("corners", self.corners, (None, 2))
        if len(corners) < 3:
            raise ValueRuleError("corners", self.corners, "at least three corners are needed")
        if not shapely.Polygon(corners).is_valid:
            raise ValueRuleError("corners", self.corners, "its edges must not cross or touch each other")

    def covers(self, points: np.ndarray) -> np.ndarray:
        """See `Shape`; even-odd rule, so that of two polygons with a common edge one covers a point on it."""
        inside = np.zeros(points.shape[:-1], dtype=bool)
        ends = np.asarray(self.corners, dtype=np.float64)
        for (x1, y1), (x2, y2) in zip(ends, np.roll(ends, -1, axis=0), strict=True):
            if y1 == y2:
                continue
            crosses = (points[..., 1] >= min(y1, y2)) & (points[..., 1] < max(y1, y2))
            edge_x = x1 + (points[..., 1] - y1) * (x2 - x1) / (y2 - y1)
            inside ^= crosses & (points[..., 0] < edge_x)
        return inside

    def bounds(self) -> np.ndarray:
        """See `Shape`."""
        return _box(self.corners, 0.0)


@dataclass(frozen=True)
class Door:
    """An opening in a wall: distance of its centre from the start of the wall, and its width."""

    at_m: float
    width_m: float

    def __post_init__(self) -> None:
        finite("at_m", self.at_m)
        positive("width_m", self.width_m)

    @property
    def sides_m(self) -> tuple[float, float]:
        """Distances of its two sides from the start of the wall."""
        return self.at_m - 0.5 * self.width_m, self.at_m + 0.5 * self.width_m


@dataclass(frozen=True)
class Wall:
    """All points within half a thickness of the segment from `start` to `end`, except in doors."""

    start: Point
    end: Point
    thickness_m: float
    doors: Sequence[Door] = ()

    def __post_init__(self) -> None:
        finite("start", self.start, (2,))
        finite("end", self.end, (2,))
        positive("thickness_m", self.thickness_m)
        length = float(np.linalg.norm(np.subtract(self.end, self.start)))
        if not length > 0:
            raise ValueRuleError("end", self.end, "it must differ from the start of the wall")
        before = 0.0
        for n, door in sorted(enumerate(self.doors), key=lambda numbered: numbered[1].at_m):
            left, right = door.sides_m
            if left < -1e-9 or right > length + 1e-9:
                raise ValueRuleError(f"doors[{n}]", door, f"it must lie within the wall's {length:.2f} m")
            if left < before - 1e-9:
                raise ValueRuleError(f"doors[{n}]", door, "it must not overlap another door")
            before = right

    def covers(self, points: np.ndarray) -> np.ndarray:
        """See `Shape`; ends are round, doors have straight sides."""
        first = np.asarray(self.start, dtype=np.float64)
        along = np.asarray(self.end, dtype=np.float64) - first
        share = ((points - first) @ along) / float(along @ along)
        nearest = first + share.clip(0.0, 1.0)[..., None] * along
        solid = np.linalg.norm(points - nearest, axis=-1) <= 0.5 * self.thickness_m
        for door in self.doors:
            left, right = np.array(door.sides_m) / np.linalg.norm(along)
            solid &= (share <= left) | (share >= right)
        return solid

    def bounds(self) -> np.ndarray:
        """See `Shape`."""
        return _box([self.start, self.end], 0.5 * self.thickness_m)


SHAPES: dict[str, type] = {"rectangle": Rectangle, "circle": Circle, "polygon": Polygon, "wall": Wall}


def shape_from(plain: Any, path: str) -> Shape:
    """Parse a shape written as `{kind: {field: value, ...}}`.

    Args:
        plain: one kind of `SHAPES` and its fields.
        path: of the shape, for errors.

    Raises:
        ValueRuleError: unknown kind, unknown or missing field, or a value that breaks its rule.
    """
    kinds = list(plain) if isinstance(plain, Mapping) else []
    if len(kinds) != 1 or kinds[0] not in SHAPES:
        raise ValueRuleError(path, plain, f"write one of {', '.join(SHAPES)} with its fields")
    return load(SHAPES[kinds[0]], plain[kinds[0]], f"{path}.{kinds[0]}")


def shapes_from(plain: Any, path: str) -> tuple[Shape, ...]:
    """Parse a list of shapes, see `shape_from`."""
    if not isinstance(plain, Sequence) or isinstance(plain, str):
        raise ValueRuleError(path, plain, "a list is needed")
    return tuple(shape_from(entry, f"{path}[{number}]") for number, entry in enumerate(plain))


def kind_of(shape: Shape) -> str:
    """Key of a shape in `SHAPES`."""
    return next(kind for kind, known in SHAPES.items() if type(shape) is known)


def _box(points: Sequence[Point], margin_m: float) -> np.ndarray:
    """An axis-aligned box around points, with a margin. [2, 2]."""
    ends = np.asarray(points, dtype=np.float64)
    return np.stack([ends.min(axis=0) - margin_m, ends.max(axis=0) + margin_m])
