"""World and agent frames.

The world frame is metric and fixed to the ground plane. The agent frame has its origin at one pedestrian;
x points forward along its heading, y to its left.
"""

from __future__ import annotations

import numpy as np


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
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def rotated_covariance(covariance: np.ndarray, angle_rad: np.ndarray) -> np.ndarray:
    """Covariance of vectors rotated counter-clockwise, R Sigma R^T.

    Args:
        covariance: symmetric. [..., 2, 2]
        angle_rad: angle of each, broadcast against the leading axes. [...]

    Returns:
        Same unit. [..., 2, 2]
    """
    columns = rotate(np.asarray(covariance), np.asarray(angle_rad)[..., None])  # (R Sigma)^T = Sigma R^T
    return rotate(np.swapaxes(columns, -1, -2), np.asarray(angle_rad)[..., None])
