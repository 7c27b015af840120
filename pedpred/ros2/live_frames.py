"""Transforms as they come (/tf, /tf_static), kept for some seconds in the tree that serves bags, too."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from pedpred.ros.frame_tree import FrameTree, frame_name
from pedpred.ros.scene_messages import seconds
from pedpred.tracking.tracks import LOST_AFTER_S

KEPT_S = 10.0
_BETWEEN = 200  # messages between two clean-ups
_log = logging.getLogger(__name__)


class LiveFrames:
    """A tree of frames that forgets what is older than `KEPT_S`, and all that moves when time goes back."""

    def __init__(self) -> None:
        self._tree, self._latest_s, self._count = FrameTree(), dict[str, float](), 0

    def add(self, message: Any, received_s: float, fixed: bool) -> None:
        """Take a tf2_msgs/TFMessage.

        Args:
            message: decoded.
            received_s: by the clock of the stamps, s.
            fixed: whether it is of /tf_static.
        """
        for one in () if fixed else message.transforms:
            child, stamp_s = frame_name(one.child_frame_id), seconds(one.header.stamp)
            latest_s = self._latest_s.get(child, -np.inf)
            if stamp_s < latest_s - LOST_AFTER_S:
                _log.warning(
                    "time of /tf goes back from %s s to %s s: transforms are forgotten", latest_s, stamp_s
                )
                self._tree.forget()
                self._latest_s.clear()
            self._latest_s[child] = max(stamp_s, self._latest_s.get(child, -np.inf))
        self._tree.add(message, received_s, fixed)
        self._count += 1
        if self._count % _BETWEEN == 0:
            self._tree.forget(max(self._latest_s.values(), default=-np.inf) - KEPT_S)

    def age_s(self, time_s: float) -> float | None:
        """How much older the latest transform is than a time, s; None if there are none."""
        return time_s - max(self._latest_s.values()) if self._latest_s else None

    def lack(self, frame: str, target: str, time_s: float) -> str:
        """Say what is missing to bring people from one frame into another; empty if nothing is."""
        return "" if frame == target else self._tree.lack(frame, target, time_s)

    def placed(self, place: np.ndarray, time_s: float, frame: str, target: str) -> np.ndarray:
        """Places of one instant in another frame, m. [N, 3] -> [N, 2]."""
        if frame == target or not len(place):
            return place[:, :2]
        instant = np.full(len(place), time_s)
        return self._tree.placed(place, instant, frame, target, (-np.inf, np.inf))[:, :2]
