"""Compensate jumps of the map -> odom transform: people do not move when the localisation is corrected."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.geometry import rotate
from pedpred.ros.tf import Frames
from pedpred.tracking.tracks import LOST_AFTER_S, TIME_TOLERANCE_S

JUMPS_MPS = 0.5
"""Faster changes are jumps; slower ones compensate wheels that slip, and positions are right as they are."""


@dataclass(frozen=True)
class _Pose:
    """Origin, m [2], and yaw, rad, of the odometry's frame in the map, at a time, s."""

    frame: str
    time_s: float
    origin: np.ndarray
    yaw_rad: float


class Localisation:
    """Finds jumps of the localisation between two messages of people."""

    def __init__(self) -> None:
        self._before: _Pose | None = None

    def correction(
        self, frames: Frames, frame: str, target: str, time_s: float, position: np.ndarray
    ) -> tuple[float, np.ndarray] | None:
        """How everything seen from the robot has moved in the target; None where that is no jump.

        Args:
            frames: all transforms.
            frame: of the people.
            target: frame of the map.
            time_s: of the people; messages that come late are ignored.
            position: of the people in the target, m. [N, 2]

        Returns:
            Turn about the target's origin, rad, then shift, m [2].
        """
        before = self._before
        after_s = np.inf if before is None else time_s - before.time_s
        if -LOST_AFTER_S <= after_s <= TIME_TOLERANCE_S:
            return None
        self._before = now = _odometry_pose(frames, frame, target, time_s)
        if now is None or before is None or now.frame != before.frame or abs(after_s) > LOST_AFTER_S:
            return None
        turn_rad = float(np.angle(np.exp(1j * (now.yaw_rad - before.yaw_rad))))
        shift = now.origin - rotate(before.origin, np.float64(turn_rad))
        moved_m = np.hypot(*(rotate(position, np.float64(turn_rad)) + shift - position).T)
        return (turn_rad, shift) if (moved_m > JUMPS_MPS * after_s).any() else None


def _odometry_pose(frames: Frames, frame: str, target: str, time_s: float) -> _Pose | None:
    """The pose of the odometry that a frame hangs on; None where there is none."""
    odometry = frames.odometry(frame, target)
    if not odometry:
        return None
    ends = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    start, tip = frames.placed(ends, time_s, odometry, target)[:, :2]
    yaw_rad = float(np.arctan2(*(tip - start)[::-1]))
    return _Pose(odometry, time_s, start, yaw_rad) if np.isfinite(yaw_rad) else None
