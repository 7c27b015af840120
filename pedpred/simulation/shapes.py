"""Obstacle shapes: each answers which points lie inside it. Metres and degrees, world frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from pedpred.errors import ConfigError
from pedpred.geometry import rotate

Point = Sequence[float]


def rectangle(points: np.ndarray, center: Point, size_m: Point, angle_deg: float = 0.0) -> np.ndarray:
    """Points (m, [..., 2]) inside a rectangle turned counter-clockwise about its centre. [...]."""
    local = np.abs(rotate(points - np.asarray(center), -np.deg2rad(angle_deg)))
    width, depth = size_m
    return (local[..., 0] <= 0.5 * width) & (local[..., 1] <= 0.5 * depth)


def circle(points: np.ndarray, center: Point, radius_m: float) -> np.ndarray:
    """Points (m, [..., 2]) inside a circle. [...]."""
    return np.linalg.norm(points - np.asarray(center), axis=-1) <= radius_m


def polygon(points: np.ndarray, corners: Sequence[Point]) -> np.ndarray:
    """Points (m, [..., 2]) inside a simple polygon, even-odd rule. [...]."""
    inside = np.zeros(points.shape[:-1], dtype=bool)
    ends = np.asarray(corners, dtype=np.float64)
    for (x1, y1), (x2, y2) in zip(ends, np.roll(ends, -1, axis=0), strict=True):
        if y1 == y2:
            continue
        crosses = (points[..., 1] >= min(y1, y2)) & (points[..., 1] < max(y1, y2))
        edge_x = x1 + (points[..., 1] - y1) * (x2 - x1) / (y2 - y1)
        inside ^= crosses & (points[..., 0] < edge_x)
    return inside


def wall(points: np.ndarray, start: Point, end: Point, thickness_m: float) -> np.ndarray:
    """Points (m, [..., 2]) within half a thickness of the segment from `start` to `end`. [...]."""
    first = np.asarray(start, dtype=np.float64)
    along = np.asarray(end, dtype=np.float64) - first
    share = ((points - first) @ along / max(float(along @ along), 1e-12)).clip(0.0, 1.0)
    nearest = first + share[..., None] * along
    return np.linalg.norm(points - nearest, axis=-1) <= 0.5 * thickness_m


SHAPES: dict[str, Callable[..., np.ndarray]] = {
    "rectangle": rectangle,
    "circle": circle,
    "polygon": polygon,
    "wall": wall,
}


def inside(points: np.ndarray, shape: Mapping[str, Any], key: str) -> np.ndarray:
    """Points inside a shape written as `{kind: {field: value, ...}}`.

    Args:
        points: world frame, m. [..., 2]
        shape: one kind of `SHAPES` and its fields.
        key: where the shape stands in the configuration, for the error.

    Raises:
        ConfigError: unknown kind, unknown or missing field, value of the wrong type.
    """
    if len(shape) != 1 or next(iter(shape)) not in SHAPES:
        raise ConfigError(key, dict(shape), f"write one of {sorted(SHAPES)} with its fields")
    kind, fields = next(iter(shape.items()))
    try:
        return SHAPES[kind](points, **fields)
    except (TypeError, ValueError) as cause:
        raise ConfigError(f"{key}.{kind}", fields, str(cause)) from cause
