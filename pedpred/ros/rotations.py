"""Rotations as unit quaternions (x, y, z, w), the last axis of an array."""

from __future__ import annotations

import numpy as np

NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


def normalised(quaternion: np.ndarray) -> np.ndarray:
    """Scale to norm 1. [..., 4]."""
    return np.asarray(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True))


def inverse(turn: np.ndarray) -> np.ndarray:
    """The rotation back. [..., 4]."""
    return turn * np.array([-1.0, -1.0, -1.0, 1.0])


def composed(second: np.ndarray, first: np.ndarray) -> np.ndarray:
    """The rotation `first`, then `second`: their Hamilton product. [..., 4]."""
    (ax, ay, az, aw), (bx, by, bz, bw) = np.moveaxis(second, -1, 0), np.moveaxis(first, -1, 0)
    product = (
        aw * bx + bw * ax + (ay * bz - az * by),
        aw * by + bw * ay + (az * bx - ax * bz),
        aw * bz + bw * az + (ax * by - ay * bx),
        aw * bw - ax * bx - ay * by - az * bz,
    )
    return normalised(np.stack(product, axis=-1))


def angle_rad(turn: np.ndarray) -> np.ndarray:
    """How far a rotation turns, from 0 to pi. [..., 4] -> [...] rad."""
    return np.asarray(2.0 * np.arctan2(np.linalg.norm(turn[..., :3], axis=-1), np.abs(turn[..., 3])))


def rotated(turn: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Places [N, 3] after rotations [N, 4]. [N, 3]."""
    x, y, z, w = turn.T
    rows = (
        (x * x - y * y - z * z + w * w, 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), -x * x + y * y - z * z + w * w, 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), -x * x - y * y + z * z + w * w),
    )
    matrix = np.ascontiguousarray(np.moveaxis(np.array(rows), -1, 0))
    return np.asarray(np.einsum("nij,nj->ni", matrix, places))


def between(before: np.ndarray, after: np.ndarray, part: np.ndarray) -> np.ndarray:
    """The rotation at a part of the shortest way from one to another, q_0 (q_0^-1 q_1)^t (Shoemake 1985).

    Args:
        before: where `part` is 0. [N, 4]
        after: where it is 1. [N, 4]
        part: t, from 0 to 1. [N]

    Returns:
        [N, 4]
    """
    way = composed(inverse(before), after)
    way = np.where(way[:, 3:] < 0, -way, way)
    sine, cosine, part = np.linalg.norm(way[:, :3], axis=1, keepdims=True), way[:, 3:], part[:, None]
    half_rad = part * np.arctan2(sine, cosine)
    share = np.where(sine > 0, np.sin(half_rad) / np.where(sine > 0, sine, 1.0), part)
    return composed(before, np.concatenate([share * way[:, :3], np.cos(half_rad)], axis=1))
