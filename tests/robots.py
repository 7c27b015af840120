"""A robot that drives and turns, who stands and walks before it, and where its camera sees them."""

import numpy as np
from scipy.spatial.transform import Rotation

STANDING, WALKING = np.array([3.0, 2.0, 0.0]), np.array([6.0, -1.0, 0.0])
SPEED = np.array([-1.0, 0.4, 0.0])


def robot(time_s):
    """Pose of base_link in odom: it drives and turns."""
    offset = np.stack([0.8 * time_s, 0.3 * np.sin(time_s), 0 * time_s], -1)
    return Rotation.from_euler("z", 0.4 * time_s), offset


CAMERA = Rotation.from_euler("xyz", [-np.pi / 2, 0.0, -np.pi / 2]), np.array([0.2, 0.1, 1.1])
"""Pose of an optical frame, which looks along its z axis, in base_link."""
ODOM = Rotation.from_euler("z", 0.7), np.array([-4.0, 1.5, 0.0])
"""Pose of odom in map."""


def from_robot(at, time_s):
    turn, offset = robot(time_s)
    return turn.inv().apply(at - offset)


def from_camera(at, time_s):
    turn, offset = CAMERA
    return turn.inv().apply(from_robot(at, time_s) - offset)
