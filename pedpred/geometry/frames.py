"""World and agent frames.

The world frame is metric and fixed to the ground plane. The agent frame sits on one pedestrian:
x points forward along the heading, y to the left.
"""

from __future__ import annotations

import numpy as np


def wrap_angle(angle_rad: np.ndarray) -> np.ndarray:
    """Map angles onto [-pi, pi). Any shape, rad."""
    wrapped = (np.asarray(angle_rad) + np.pi) % (2.0 * np.pi) - np.pi
    return np.where(wrapped < np.pi, wrapped, -np.pi)  # a hair below -pi would be rounded to pi


def rotate(vectors: np.ndarray, angle_rad: np.ndarray) -> np.ndarray:
    """Turn vectors counter-clockwise.

    Args:
        vectors: (x, y) components. [..., 2]
        angle_rad: angle of each vector, broadcast against the leading axes. [...]

    Returns:
        Turned vectors. [..., 2]
    """
    vectors = np.asarray(vectors)
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def rotated_covariance(covariance: np.ndarray, angle_rad: np.ndarray) -> np.ndarray:
    """Covariance of vectors that are turned counter-clockwise, R Sigma R^T.

    Args:
        covariance: symmetric. [..., 2, 2]
        angle_rad: angle of each, broadcast against the leading axes. [...]

    Returns:
        Same unit. [..., 2, 2]
    """
    columns = rotate(np.asarray(covariance), np.asarray(angle_rad)[..., None])  # (R Sigma)^T = Sigma R^T
    return rotate(np.swapaxes(columns, -1, -2), np.asarray(angle_rad)[..., None])


def to_agent(points: np.ndarray, origin: np.ndarray, heading_rad: np.ndarray) -> np.ndarray:
    """Express world points in the frame of an agent.

    Args:
        points: world frame, m. [..., 2]
        origin: position of the agent, world frame, m. [..., 2]
        heading_rad: heading of the agent, counter-clockwise from world x. [...]

    Returns:
        Agent frame, (forward, left), m. [..., 2]
    """
    return rotate(np.asarray(points) - origin, -np.asarray(heading_rad))


def to_world(points: np.ndarray, origin: np.ndarray, heading_rad: np.ndarray) -> np.ndarray:
    """Inverse of `to_agent`: agent frame to world frame, m, [..., 2]."""
    return rotate(points, heading_rad) + origin
