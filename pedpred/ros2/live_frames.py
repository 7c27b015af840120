"""Transforms as they come (/tf, /tf_static), kept for some seconds in the tree that serves bags, too."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from pedpred.ros.frame_tree import LONGEST_GAP_S, FrameTree, frame_name, lacks_height
from pedpred.ros.localisation import ALWAYS, Poses, find_poses
from pedpred.ros.scene_messages import seconds
from pedpred.tracking.tracks import LOST_AFTER_S

KEPT_S = 10.0
MOST_POSES, MOST_FRAMES = 10_000, 1000
"""Of an edge, such as 10 s at 1000 Hz; and frames that move, such as one per person."""
_BETWEEN = 200  # transforms between two clean-ups
_log = logging.getLogger(__name__)


class LiveFrames:
    """A tree of frames that forgets what is older than `KEPT_S`, and a frame whose time goes back.

    A frame that gets another parent is in that one once no pose in the former one is near any more; at once,
    if it is fixed there.
    Each frame has a clock of its own here: a publisher with false stamps spoils its own frame, no other one.
    """

    def __init__(self) -> None:
        self._tree, self._latest_s, self._count = FrameTree(), dict[str, float](), 0

    def add(self, message: Any, received_s: float, fixed: bool) -> None:
        """Take a tf2_msgs/TFMessage.

        Args:
            message: decoded.
            received_s: by the clock of the stamps, s; the time of what has none.
            fixed: whether it is of /tf_static.
        """
        for one in message.transforms:
            stamp_s = seconds(one.header.stamp) or received_s
            child, parent = frame_name(one.child_frame_id), frame_name(one.header.frame_id)
            if not fixed:
                self._notice_jumps(child, stamp_s)
            if self._tree.hold(one, received_s, stamp_s, fixed):
                self._tree.leave_others(child, parent, np.inf if fixed else stamp_s - LONGEST_GAP_S)
            self._count += 1
            if self._count % _BETWEEN == 0:
                self._tree.trim(KEPT_S, MOST_POSES, MOST_FRAMES)
                there = (child for child in self._latest_s if self._tree.chain(child)[1:])
                self._latest_s = {child: self._latest_s[child] for child in there}

    def _notice_jumps(self, child: str, stamp_s: float) -> None:
        latest_s = self._latest_s.get(child, -np.inf)
        if stamp_s < latest_s - LOST_AFTER_S:
            _log.warning(
                "time of /tf goes back from %s s to %s s: transforms of %r are forgotten",
                *(latest_s, stamp_s, child),
            )
            self._tree.forget(child)
            latest_s = -np.inf
        self._latest_s[child] = max(stamp_s, latest_s)

    def age_s(self, frame: str, target: str, time_s: float) -> float | None:
        """See `FrameTree.age_s`."""
        return self._tree.age_s(frame, target, time_s)

    def lack(self, frame: str, target: str, time_s: float) -> str:
        """Say what is missing to bring people from one frame into another; empty if nothing is."""
        if frame == target:
            return ""
        return self._tree.lack(frame, target, time_s) if frame else "they name no frame (header.frame_id)"

    def odometry(self, frame: str, target: str, time_s: float) -> Poses | None:
        """How the odometry that people are seen from lies in another frame; None where that is unknown."""
        poses = find_poses(self._tree, frame, target, np.array([time_s]))
        return poses if poses is not None and np.isfinite(poses.yaw_rad).all() else None

    def base(self, frame: str, target: str, time_s: float) -> np.ndarray:
        """Where the base of the robot is that people are seen from; NaN if that is unknown, m. [3]."""
        if not (base := self._tree.base(frame)) or self._tree.lack(base, target, time_s):
            return np.full(3, np.nan)
        return self._tree.placed(np.zeros((1, 3)), np.array([time_s]), base, target, ALWAYS)[0]

    def placed(self, place: np.ndarray, time_s: float, frame: str, target: str) -> np.ndarray:
        """Places of one instant in another frame, m. [N, 3]."""
        if frame == target or not len(place):
            return place
        instant = np.full(len(place), time_s)
        here = self._tree.placed(place, instant, frame, target, ALWAYS)
        if flat := lacks_height(here).sum():
            _log.warning("%d people have no height in %r, which is tilted: give heights", flat, frame)
        return here
