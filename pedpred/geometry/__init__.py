"""Coordinate frames: world (x, y) in metres, agent (x forward, y left), image (row, column)."""

from pedpred.geometry.frames import rotate, rotated_covariance
from pedpred.geometry.homography import Homography

__all__ = ["Homography", "rotate", "rotated_covariance"]
