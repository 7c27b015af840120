"""Coordinate frames that move: the transforms of /tf and /tf_static, by the rules of tf2, which has no wheel.

A frame has one parent, that of its last transform. Poses are interpolated between two samples, and never
extrapolated. Rotations are unit quaternions (x, y, z, w), the last axis of an array.
"""

from __future__ import annotations

import logging
from array import array
from typing import Any

import numpy as np

from pedpred.ros.scene_messages import seconds
from pedpred.scenes import rule_of
from pedpred.tracking.tracks import LOST_AFTER_S

MAP_FRAME = "map"
MOST_POSES, MOST_FRAMES = 10_000, 1000
"""Limits of a live stream: poses of a frame, such as 10 s at 1000 Hz, and frames, such as one per person."""
_SAME_M, _SAME_RAD = 0.001, 0.001
_NORM_ERROR = 0.1
_COLUMNS = 8  # stamp (s), translation (m), quaternion (x, y, z, w)
_log = logging.getLogger(__name__)


def frame_name(name: str) -> str:
    """A frame's name without the leading slash of early ROS."""
    return name.lstrip("/")


def is_robot_base(frame: str) -> bool:
    """Whether a frame has the name of one that is fixed to a robot (REP 105)."""
    return frame.rpartition("/")[2] in ("base_link", "base_footprint")


def _is_odometry(frame: str) -> bool:
    """Whether a frame has the name of one in which a robot never jumps, while it may on the map (REP 105)."""
    return any(word.startswith("odom") for word in frame.rpartition("/")[2].split("_"))


class Frames:
    """Poses of frames in their parents, over time.

    Args:
        kept_s: for a live stream: older poses are dropped, all of a frame whose stamps jump back by more
            than `LOST_AFTER_S`, and those above `MOST_POSES` and `MOST_FRAMES`; None: everything is kept, s.
    """

    def __init__(self, kept_s: float | None = None):
        self._kept_s = kept_s
        self._edges: dict[str, _Edge] = {}  # by child, the latest one last

    def add(self, message: Any, received_s: float, fixed: bool) -> None:
        """Add a tf2_msgs/TFMessage; impossible poses are left out.

        Args:
            message: decoded.
            received_s: by the clock of the stamps, s; the time of transforms without a stamp.
            fixed: whether it is of /tf_static.
        """
        for one in message.transforms:
            child, parent = frame_name(one.child_frame_id), frame_name(one.header.frame_id)
            at, turn = one.transform.translation, one.transform.rotation
            pose = np.array([at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w])
            is_sound = rule_of("position", pose)[1].all()
            if child != parent and is_sound and abs(np.linalg.norm(pose[3:]) - 1.0) < _NORM_ERROR:
                self._add(child, parent, seconds(one.header.stamp) or received_s, pose, fixed)

    def _add(self, child: str, parent: str, stamp_s: float, pose: np.ndarray, fixed: bool) -> None:
        edge = self._edges.pop(child, None)
        if edge is None or fixed or edge.is_fixed or edge.parent != parent:
            edge = _Edge(parent, fixed)
        elif self._kept_s is not None and stamp_s < edge.latest_s - LOST_AFTER_S:
            text = "/tf: stamps of %r go back from %s s to %s s: its earlier transforms are forgotten"
            _log.warning(text, child, edge.latest_s, stamp_s)
            edge = _Edge(parent, fixed)
        edge.add(stamp_s, pose, self._kept_s)
        self._edges[child] = edge
        if self._kept_s is not None and len(self._edges) > MOST_FRAMES:
            moving = (name for name, one in self._edges.items() if not one.is_fixed)
            del self._edges[next(moving, next(iter(self._edges)))]

    def chain(self, frame: str) -> list[str]:
        """A frame, its parent and so on, up to the topmost one, or around a loop once."""
        frames = [frame]
        while (edge := self._edges.get(frames[-1])) and edge.parent not in frames:
            frames.append(edge.parent)
        return frames

    def moves(self, frame: str) -> bool:
        """Whether a frame, or one above it, has different poses in its parent."""
        return any(self._edges[child].moves() for child in self.chain(frame) if child in self._edges)

    def explain_missing(self, frame: str, target: str, time_s: float) -> str:
        """Name the transform that is missing between two frames at a time; empty if none is."""
        if frame == target:
            return ""
        if not frame:
            return "they name no frame (header.frame_id)"
        up, down = self._chains(frame, target)
        if up[-1] != down[-1]:
            ends = " and ".join(
                f"{chain[0]!r} ends at {chain[-1]!r}" if len(chain) > 1 else f"{chain[0]!r} has no parent"
                for chain in (up, down)
            )
            return f"no /tf leads from {frame!r} to {target!r}: {ends}"
        for child in (*up[:-1], *down[:-1]):
            edge = self._edges[child]
            if problem := edge.explain_missing(time_s):
                return f"the transform of {child!r} in {edge.parent!r} is {problem}"
        return ""

    def placed(self, points: np.ndarray, time_s: float | np.ndarray, frame: str, target: str) -> np.ndarray:
        """Transform points from one frame into another.

        Args:
            points: m. [N, 3]
            time_s: of all points, or of each, by the clock of the stamps, s. [] or [N]
            frame: of the points.
            target: the other frame.

        Returns:
            m; NaN where a transform is missing at that time. [N, 3]
        """
        up, down = self._chains(frame, target)
        if up[-1] != down[-1]:
            return np.full_like(points, np.nan, np.float64)
        times_s = np.atleast_1d(np.asarray(time_s, np.float64))
        moved = np.asarray(points, np.float64)
        for child in up[:-1]:
            turn, offset = self._edges[child].poses(times_s)
            moved = rotate_points(turn, moved) + offset
        for child in reversed(down[:-1]):
            turn, offset = self._edges[child].poses(times_s)
            moved = rotate_points(inverse(turn), moved - offset)
        return moved

    def base(self, frame: str) -> str:
        """The base of the robot that a frame belongs to, else the only one that there is; empty: none."""
        chains = [self.chain(name) for name in self._edges if is_robot_base(name)]
        topmost = {[name for name in chain if is_robot_base(name)][-1] for chain in chains}
        own = [name for name in self.chain(frame) if name in topmost]
        return own[-1] if own else "".join(topmost if len(topmost) == 1 else ())

    def odometry(self, frame: str, target: str) -> str:
        """The frame below a target, at or above another frame, in which the robot's base moves; empty: none.

        Only the localisation moves it in the target. It is the parent of a base, or called odom.
        """
        above = set(self.chain(target))
        parents = {
            edge.parent for name, edge in self._edges.items() if is_robot_base(name) and not edge.is_fixed
        }
        below = [name for name in self.chain(frame) if name not in above and not is_robot_base(name)]
        return next((name for name in below if name in parents or _is_odometry(name)), "")

    def _chains(self, frame: str, target: str) -> tuple[list[str], list[str]]:
        """The chains of two frames, up to the first frame that is in both; whole ones where none is."""
        up, down = self.chain(frame), self.chain(target)
        for name in up:
            if name in down:
                return up[: up.index(name) + 1], down[: down.index(name) + 1]
        return up, down


class _Edge:
    """Poses of a frame in its parent.

    Attributes:
        parent: its name.
        is_fixed: whether its only pose holds at all times.
        latest_s: the latest stamp, s.
    """

    def __init__(self, parent: str, is_fixed: bool):
        self.parent, self.is_fixed, self.latest_s = parent, is_fixed, -np.inf
        self._samples = array("d")
        self._sorted: np.ndarray | None = None

    def add(self, stamp_s: float, pose: np.ndarray, kept_s: float | None) -> None:
        """Add a pose: translation, quaternion [7]; see `Frames` for the time for which poses are kept."""
        self._samples.extend((stamp_s, *pose))
        self.latest_s, self._sorted = max(stamp_s, self.latest_s), None
        is_full = len(self._samples) > 2 * MOST_POSES * _COLUMNS
        if kept_s is not None and (is_full or self._samples[0] < self.latest_s - 2.0 * kept_s):
            table = np.array(self._samples).reshape(-1, _COLUMNS)
            table = table[table[:, 0] >= self.latest_s - kept_s][-MOST_POSES:]
            self._samples = array("d", table.tobytes())

    def moves(self) -> bool:
        """Whether there are different poses."""
        _, turn, offset = self._poses()
        far = np.linalg.norm(np.diff(offset, axis=0), axis=1) > _SAME_M
        cosine = np.abs((turn[1:] * turn[:-1]).sum(axis=1))
        return bool((far | (cosine < np.cos(_SAME_RAD / 2))).any())

    def explain_missing(self, time_s: float) -> str:
        """Say why there is no pose at a time; empty if there is one."""
        if np.isfinite(self.poses(np.array([time_s]))[1]).all():
            return ""
        first_s = self._poses()[0][0]
        if time_s < first_s:
            return f"{first_s - time_s:.3g} s later than the people, and it is the first one"
        return f"{time_s - self.latest_s:.3g} s older than the people"

    def poses(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Turn [T, 4] and offset, m, NaN if unknown [T, 3], at some times, s [T]."""
        known_s, turn, offset = self._poses()
        if self.is_fixed:
            last = np.full(len(time_s), -1)
            return turn[last], offset[last]
        after = np.searchsorted(known_s, time_s).clip(0, len(known_s) - 1)
        before = np.maximum(after - (known_s[after] > time_s), 0)
        gap_s = known_s[after] - known_s[before]
        share = np.where(gap_s > 0, (time_s - known_s[before]) / np.where(gap_s > 0, gap_s, 1.0), 0.0)
        position = (1.0 - share[:, None]) * offset[before] + share[:, None] * offset[after]
        position[(time_s < known_s[0]) | (time_s > known_s[-1])] = np.nan
        return interpolate(turn[before], turn[after], share), position

    def _poses(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times [S], turns [S, 4] and offsets [S, 3] in order of time; of two at one time the last one."""
        if self._sorted is None:
            table = np.array(self._samples).reshape(-1, _COLUMNS)[::-1]
            self._sorted = table[np.unique(table[:, 0], return_index=True)[1]]
            self._sorted[:, 4:] /= np.linalg.norm(self._sorted[:, 4:], axis=1, keepdims=True)
        return self._sorted[:, 0], self._sorted[:, 4:], self._sorted[:, 1:4]


def inverse(turn: np.ndarray) -> np.ndarray:
    """The rotation back. [..., 4]."""
    return turn * np.array([-1.0, -1.0, -1.0, 1.0])


def rotate_points(turn: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Rotate points, p + 2 v x (v x p + w p) with the vector part v. [N or 1, 4], [N, 3] -> [N, 3]."""
    vector, w = turn[:, :3], turn[:, 3:]
    return np.asarray(points + 2.0 * np.cross(vector, np.cross(vector, points) + w * points))


def interpolate(before: np.ndarray, after: np.ndarray, share: np.ndarray) -> np.ndarray:
    """The rotation at a share of the shortest way, slerp (Shoemake 1985). [N, 4], [N, 4], [N] -> [N, 4]."""
    after = np.where((before * after).sum(axis=1, keepdims=True) < 0, -after, after)
    apart, together = (np.linalg.norm(q, axis=1, keepdims=True) for q in (after - before, after + before))
    angle_rad, share = 2.0 * np.arctan2(apart, together), share[:, None]
    sine = np.sin(angle_rad)
    divisor = np.where(sine > 0, sine, 1.0)
    first, second = (
        np.where(sine > 0, np.sin(part * angle_rad) / divisor, part) for part in (1.0 - share, share)
    )
    return np.asarray(first * before + second * after)
