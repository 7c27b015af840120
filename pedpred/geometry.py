"""Coordinate frames: world, agent and image, and the maps between them.

The world frame, (x, y) in metres, is fixed to the ground plane. The agent frame has its origin at one
pedestrian; x points forward along its heading, y to its left. Images have (row, column) in pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pedpred.arrays import real_numbers
from pedpred.compiled import compiled
from pedpred.errors import ValueRuleError, shape_error

_SMALLEST_CONDITION = 1e-12


def rotate(vectors: np.ndarray, angle_rad: np.ndarray) -> np.ndarray:
    """Rotate vectors counter-clockwise.

    Args:
        vectors: (x, y) components. [..., 2]
        angle_rad: angle of each vector, broadcast against the leading axes. [...]

    Returns:
        Rotated vectors. [..., 2]
    """
    vectors = np.asarray(vectors)
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    x, y = vectors[..., 0], vectors[..., 1]
    forward = cos * x - sin * y
    turned = np.empty((*forward.shape, 2), forward.dtype)
    turned[..., 0], turned[..., 1] = forward, sin * x + cos * y
    return turned


def placed(points: np.ndarray, origin: np.ndarray, heading_rad: np.ndarray) -> np.ndarray:
    """Points in agent frames, as seen from the world.

    Args:
        points: (x, y) in each agent's frame, m. [W, ..., 2]
        origin: where the agents are, world frame, m. [W, 2]
        heading_rad: direction of their x axes. [W]

    Returns:
        World frame, m. [W, ..., 2] float64
    """
    points_in_map = np.empty((len(points), math.prod(points.shape[1:-1]), 2))
    _place(
        points.reshape(points_in_map.shape), origin, np.cos(heading_rad), np.sin(heading_rad), points_in_map
    )
    return points_in_map.reshape(points.shape)


@compiled
def _place(points, origin, cos, sin, placed):  # pragma: no cover (compiled)
    """Writes into `placed`."""
    for w in range(len(points)):
        for m in range(points.shape[1]):
            x, y = points[w, m, 0], points[w, m, 1]
            placed[w, m, 0] = origin[w, 0] + (cos[w] * x - sin[w] * y)
            placed[w, m, 1] = origin[w, 1] + (sin[w] * x + cos[w] * y)


def rotated_covariance(covariance: np.ndarray, angle_rad: np.ndarray) -> np.ndarray:
    """Covariance of vectors rotated counter-clockwise, R Sigma R^T.

    Args:
        covariance: symmetric. [W, ..., 2, 2]
        angle_rad: of each row. [W]

    Returns:
        Same unit. [W, ..., 2, 2] float64
    """
    rotated = np.empty((len(covariance), math.prod(covariance.shape[1:-2]), 2, 2))
    _turn(covariance.reshape(rotated.shape), np.cos(angle_rad), np.sin(angle_rad), rotated)
    return rotated.reshape(covariance.shape)


@compiled
def _turn(covariance, cos, sin, rotated):  # pragma: no cover (compiled)
    """Writes into `rotated`."""
    for w in range(len(covariance)):
        c, s = cos[w], sin[w]
        for m in range(covariance.shape[1]):
            for k in range(2):  # R Sigma, then its rows times R^T
                x, y = covariance[w, m, 0, k], covariance[w, m, 1, k]
                rotated[w, m, 0, k], rotated[w, m, 1, k] = c * x - s * y, s * x + c * y
            for k in range(2):
                x, y = rotated[w, m, k, 0], rotated[w, m, k, 1]
                rotated[w, m, k, 0], rotated[w, m, k, 1] = c * x - s * y, s * x + c * y


@dataclass(frozen=True)
class Homography:
    """Plane-to-plane map, world ~ H (row, column, 1).

    Attributes:
        matrix: H, from image (row, column, 1) to world (x, y, 1) up to scale. [3, 3]
        first_pixel: index of the first row and column in the convention of H (1 for MATLAB, 0 for
            numpy). All methods count pixels from 0.
    """

    matrix: np.ndarray
    first_pixel: int = 0

    def __post_init__(self) -> None:
        matrix = real_numbers("homography", self.matrix).astype(np.float64)
        if matrix.shape != (3, 3):
            raise shape_error("homography", matrix.shape, "(3, 3)")
        if not np.isfinite(matrix).all():
            raise ValueRuleError("homography", matrix.tolist(), "all nine numbers must be finite")
        singular = np.linalg.svd(matrix, compute_uv=False)
        if singular[-1] <= _SMALLEST_CONDITION * singular[0]:
            raise ValueRuleError("homography", matrix.tolist(), "the matrix must be invertible")
        object.__setattr__(self, "matrix", matrix)

    def to_world(self, pixels_rc: np.ndarray) -> np.ndarray:
        """Map image points onto the ground plane.

        Args:
            pixels_rc: image frame, (row, column), px, counted from 0. [..., 2]

        Returns:
            World frame, (x, y), m. [..., 2]

        Raises:
            ValueRuleError: the last axis is not 2.
        """
        return _project(self.matrix, _pairs(pixels_rc, "pixels_rc") + self.first_pixel)

    def to_image(self, points: np.ndarray) -> np.ndarray:
        """Inverse of `to_world`: world (x, y), m, to image (row, column), px from 0, [..., 2]."""
        inverse = np.linalg.inv(self.matrix)
        return _project(inverse, _pairs(points, "points")) - self.first_pixel


def _pairs(points: np.ndarray, field: str) -> np.ndarray:
    points = real_numbers(field, points).astype(np.float64, copy=False)
    if points.ndim == 0 or points.shape[-1] != 2:
        raise shape_error(field, points.shape, "[..., 2]")
    return points


def _project(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # the horizon maps to infinity
        homogeneous = points @ matrix[:, :2].T + matrix[:, 2]
        return homogeneous[..., :2] / homogeneous[..., 2:]
