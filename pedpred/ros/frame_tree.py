"""Coordinate frames that move: the transforms of a bag (/tf, /tf_static), and places in other frames."""

from __future__ import annotations

from array import array
from itertools import islice, pairwise
from typing import Any

import numpy as np

from pedpred.ros.rotations import NO_TURN, angle_rad, between, composed, inverse, normalised, rotated
from pedpred.ros.scene_messages import seconds
from pedpred.scenes import rule_of
from pedpred.tracking.steps import are_too_long

MAP_FRAME = "map"
HELD_S, LONGEST_GAP_S = 0.02, 1.0
"""Of a frame that moves, s: a pose holds so long before the first and after the last sample; longer gaps
are not interpolated. Where it does not move, the first and the last pose hold for the longer time."""
_SAME_M, _SAME_RAD = 0.001, 0.001
_ALWAYS = (-np.inf, np.inf)
_NO_UNIT = 0.1  # a quaternion has the norm 1
_LEVEL = 0.1
"""A frame is level if heights shift places by no larger share of them: 1 m by no more than detectors err."""
_TOLD = 5  # frames of a loop
_COLUMNS = 9  # received (s), stamp (s), translation (m), quaternion (x, y, z, w)


def frame_name(name: str) -> str:
    """A frame's name without the leading slash of early ROS."""
    return name.lstrip("/")


def lacks_height(moved: np.ndarray) -> np.ndarray:
    """Which places of `FrameTree.placed` are unknown for lack of a height alone. [N] bool."""
    return np.asarray(np.isnan(moved[:, :2]).all(axis=1) & np.isfinite(moved[:, 2]))


def is_robots(frame: str) -> bool:
    """Whether a frame has the name of one that moves with a robot (REP 105)."""
    return frame.rpartition("/")[2] in ("base_link", "base_footprint")


def _is_odometrys(frame: str) -> bool:
    """Whether a frame has the name of one in which a robot never jumps, while it may on the map (REP 105)."""
    return any(word.startswith("odom") for word in frame.rpartition("/")[2].split("_"))


class FrameTree:
    """Poses of frames in their parents, over time."""

    def __init__(self) -> None:
        self._samples: dict[str, dict[str, array[float]]] = {}
        self._fixed: set[tuple[str, str]] = set()

    def add(self, message: Any, received_s: float, fixed: bool) -> None:
        """Take a tf2_msgs/TFMessage; those of /tf_static are fixed. Impossible poses are left out."""
        for one in message.transforms:
            self.hold(one, received_s, seconds(one.header.stamp), fixed)

    def hold(self, one: Any, received_s: float, stamp_s: float, fixed: bool) -> bool:
        """Take a geometry_msgs/TransformStamped, unless its pose is impossible.

        Args:
            one: decoded.
            received_s: when it came, s.
            stamp_s: the time that it is about, s.
            fixed: whether it holds always.

        Returns:
            Whether it was taken.
        """
        child, parent = frame_name(one.child_frame_id), frame_name(one.header.frame_id)
        at, turn = one.transform.translation, one.transform.rotation
        pose = np.array([at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w])
        sound = rule_of("position", pose)[1].all() and abs(np.linalg.norm(pose[3:]) - 1.0) < _NO_UNIT
        if child == parent or not sound:
            return False
        samples = self._samples.setdefault(child, {}).setdefault(parent, array("d"))
        if fixed:
            self._fixed.add((child, parent))
            del samples[:]  # the one that came last holds, whatever its stamp
        samples.extend((received_s, stamp_s, *pose))
        return True

    def forget(self, child: str) -> None:
        """Drop the poses of a frame, but fixed ones."""
        kept = {
            parent: samples
            for parent, samples in self._samples.pop(child, {}).items()
            if (child, parent) in self._fixed
        }
        if kept:
            self._samples[child] = kept

    def leave_others(self, child: str, parent: str, since_s: float) -> None:
        """Drop the poses of a frame in other parents that ended before a time by the clock of the stamps.

        Fixed ones stay, unless the frame is fixed in this parent now. Without this, the parent with the most
        poses counts.
        """
        parents = self._samples.get(child, {})
        lasting = set() if (child, parent) in self._fixed else self._fixed
        for other in [name for name in parents if name != parent and (child, name) not in lasting]:
            if parents[other][1 - _COLUMNS] < since_s:  # the stamp of the last one
                del parents[other]
                self._fixed.discard((child, other))

    def trim(self, kept_s: float, most_poses: int, most_frames: int) -> None:
        """Drop poses that are much older than the latest one of their edge, and frames that are too many.

        Args:
            kept_s: how much older, by the clock of the stamps; the latest one stays, and of a fixed edge no
                other one, s.
            most_poses: of an edge; those that came last stay.
            most_frames: that move; those whose poses came last stay.
        """
        came_s: dict[str, float] = {}
        for child, parents in self._samples.items():
            for parent, samples in parents.items():
                rows = np.array(samples).reshape(-1, _COLUMNS)
                if (child, parent) in self._fixed:
                    rows = rows[-1:]
                else:
                    came_s[child] = max(rows[-1, 0], came_s.get(child, -np.inf))
                    rows = rows[rows[:, 1] >= rows[:, 1].max() - kept_s][-most_poses:]
                parents[parent] = array("d", rows.ravel())
        for child in sorted(came_s, key=came_s.__getitem__)[: max(len(came_s) - most_frames, 0)]:
            self.forget(child)

    def age_s(self, frame: str, target: str, time_s: float) -> float | None:
        """How much older than a time the latest pose is of the edge between two frames that lags most, s.

        None where no frame between them moves, infinite where no transforms connect them.
        """
        up, down = self._chains(frame, target)
        if up[-1] != down[-1]:
            return np.inf
        edges = {*pairwise(up), *pairwise(down)} - self._fixed
        return max((time_s - float(self._known(edge)[0][-1]) for edge in edges), default=None)

    def lag_s(
        self, frame: str, target: str, time_s: np.ndarray, received_s: np.ndarray
    ) -> tuple[str, str, float]:
        """By how much messages are stamped later than the poses that came last before them, as a rule.

        Args:
            frame: of the messages.
            target: the frame into which they are brought.
            time_s: their stamps, s. [N]
            received_s: when they came, s. [N]

        Returns:
            Child and parent of the edge between both frames that differs most, of those that move, and the
            median, less the time between its poses, s; 0 where nothing moves.
        """
        lags = [("", "", 0.0)]
        for child, parent in self._moving(frame, target):
            rows = np.asarray(self._samples[child][parent]).reshape(-1, _COLUMNS)
            rows = rows[np.argsort(rows[:, 0], kind="stable")]
            last = np.searchsorted(rows[:, 0], received_s, side="right") - 1
            if not (last >= 0).any() or not rows[:, 1].any():
                continue
            lag_s = float(np.median(time_s[last >= 0] - rows[last[last >= 0], 1]))
            step_s = float(np.median(np.diff(np.sort(rows[:, 1]))))
            lags.append((child, parent, min(lag_s, 0.0) + max(lag_s - step_s, 0.0)))
        return max(lags, key=lambda lag: abs(lag[2]))

    def jumps(self, frame: str, target: str) -> tuple[str, str, int, int]:
        """How often a frame between two frames moves as nobody does, as where two nodes publish its poses.

        Returns:
            Child and parent of the edge with the largest share of such steps; how many of its steps are such,
            and how many it has; 0 of 1 where nothing moves.
        """
        counts = [("", "", 0, 1)]
        for child, parent in self._moving(frame, target):
            known_s, _, offset = self._known((child, parent))
            far = are_too_long(np.linalg.norm(np.diff(offset, axis=0), axis=1), np.diff(known_s))
            counts.append((child, parent, int(far.sum()), len(far)))
        return max(counts, key=lambda one: one[2] / one[3])

    def _moving(self, frame: str, target: str) -> list[tuple[str, str]]:
        """Child and parent of the edges between two frames that are seen at different poses."""
        up, down = self._chains(frame, target)
        edges = (edge for edge in (*pairwise(up), *pairwise(down)) if edge not in self._fixed)
        return [edge for edge in edges if _moves(*self._known(edge)[1:]).any()]

    def lack(self, frame: str, target: str, time_s: float) -> str:
        """Say what is missing to bring a place from one frame into another at a time; empty if nothing is."""
        up, down = self._chains(frame, target)
        if up[-1] != down[-1]:
            above = {name: chain[-1] for name, chain in ((frame, up), (target, down))}
            ends = " and ".join(f"{name!r} {self._end(name, top)}" for name, top in above.items())
            return f"no /tf leads from {frame!r} to {target!r}: {ends}"
        for child, parent in (*pairwise(up), *pairwise(down)):
            if np.isfinite(self._poses((child, parent), np.array([time_s]), _ALWAYS)[1]).all():
                continue
            known_s = self._known((child, parent))[0]
            age = f"{time_s - known_s[-1]:.3g} s older than the people"
            if time_s < known_s[0]:
                age = f"{known_s[0] - time_s:.3g} s later than the people, and it is the first one"
            elif time_s <= known_s[-1]:
                age = "far from those before it: no transform is near the people's time"
            return f"the transform of {child!r} in {parent!r} is {age}"
        return ""

    def chain(self, frame: str) -> list[str]:
        """A frame, its parent and so on, up to the topmost one."""
        frames = [frame]
        while (parents := self._samples.get(frames[-1])) and len(frames) <= len(self._samples):
            parent = max(parents, key=lambda name: len(parents[name]))
            if parent in frames:
                break
            frames.append(parent)
        return frames

    def _chains(self, frame: str, target: str) -> tuple[list[str], list[str]]:
        """The chains of two frames, up to the first one that is in both; whole ones where none is."""
        up, down = self.chain(frame), self.chain(target)
        while up[-2:] == down[-2:] and min(len(up), len(down)) > 1:
            up, down = up[:-1], down[:-1]
        return up, down

    def odometry(self, frame: str, target: str) -> str:
        """The frame, from another one up to a target, in which the robot never jumps; empty: there is none.

        The localisation alone moves it. It is the one in which the robot's base moves, whatever it is called;
        where none is called like a base, the one that is called like odometry.
        """
        above = set(self.chain(target))
        below = [name for name in self.chain(frame) if name not in above]
        bases = {parent for base in self._bases() for parent in self._moves_in(base)}
        named = (name for name in below if _is_odometrys(name))
        return next((name for name in below if name in bases), next(named, ""))

    def base(self, frame: str) -> str:
        """The robot's base that a frame belongs to, else the only one that there is; empty: there is none."""
        bases = self._bases()
        mine = [name for name in self.chain(frame) if name in bases]
        return mine[-1] if mine else "".join(bases if len(bases) == 1 else ())

    def _bases(self) -> set[str]:
        """The bases of all robots; of one within another the upper one."""
        return {
            [name for name in self.chain(base) if is_robots(name)][-1]
            for base in self._samples
            if is_robots(base)
        }

    def _moves_in(self, base: str) -> list[str]:
        """The frame in which a base moves; none where it has no parent."""
        moving = (edge[1] for edge in pairwise(self.chain(base)) if edge not in self._fixed)
        return list(islice(moving, 1))

    def _end(self, frame: str, top: str) -> str:
        if top in self._samples:
            return (
                f"is in a loop: {' in '.join(map(repr, (*self.chain(frame)[-_TOLD:], *self._samples[top])))}"
            )
        return "has no parent" if top == frame else f"ends at {top!r}"

    def moves(self, frame: str) -> bool:
        """Whether a frame, or one above it, is seen at different poses in its parent."""
        chain = self.chain(frame)
        return any(_moves(*self._known(edge)[1:]).any() for edge in pairwise(chain))

    def placed(
        self, place: np.ndarray, time_s: np.ndarray, frame: str, target: str, heard_s: tuple[float, float]
    ) -> np.ndarray:
        """Places in one frame, as seen in another one below the same topmost one.

        Args:
            place: m; a height that is NaN is unknown, and counts only where a frame is tilted. [N, 3]
            time_s: when each was there, by the clock of the stamps, s. [N]
            frame: that of the places.
            target: the other frame.
            heard_s: which transforms count: those that the bag received from when to when, s.

        Returns:
            m; NaN where a transform is missing at that time; x and y alone are NaN where they depend on a
            height that is unknown. [N, 3]
        """
        unknown = np.flatnonzero(np.isnan(place[:, 2]))
        ground = place.astype(np.float64)
        ground[unknown, 2] = 0.0
        moved = self._moved(ground, time_s, frame, target, heard_s)
        if len(unknown):
            higher = self._moved(ground[unknown] + [0.0, 0.0, 1.0], time_s[unknown], frame, target, heard_s)
            shift_m = np.linalg.norm((higher - moved[unknown])[:, :2], axis=1)
            moved[unknown[shift_m > _LEVEL], :2] = np.nan
        return moved

    def _moved(
        self, place: np.ndarray, time_s: np.ndarray, frame: str, target: str, heard_s: tuple[float, float]
    ) -> np.ndarray:
        """See `placed`, of places whose heights are known. [N, 3]."""
        up, down = self._chains(frame, target)
        moved = place
        for edge in pairwise(up):
            turn, offset = self._poses(edge, time_s, heard_s)
            moved = rotated(turn, moved) + offset
        for edge in reversed(list(pairwise(down))):
            turn, offset = self._poses(edge, time_s, heard_s)
            moved = rotated(inverse(turn), moved - offset)
        return moved

    def _poses(
        self, edge: tuple[str, str], time_s: np.ndarray, heard_s: tuple[float, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pose of a frame in its parent at some times: turn [N, 4], and offset, NaN if unknown, m. [N, 3]."""
        if edge in self._fixed:
            turn, offset = (part[-1:] for part in self._known(edge)[1:])
            last = np.zeros(len(time_s), np.int64)
            return turn[last], offset[last]
        known_s, turn, offset = self._known(edge, heard_s, time_s)
        if not len(known_s):
            return np.tile(NO_TURN, (len(time_s), 1)), np.full((len(time_s), 3), np.nan)
        moved = _moves(turn, offset)
        rows = np.r_[0, np.arange(len(known_s)), len(known_s) - 1]  # the first and the last one hold a little
        held_s = [HELD_S if len(moved) and moved[end] else LONGEST_GAP_S for end in (0, -1)]
        known_s, turn, offset = (
            known_s[rows] + np.r_[-held_s[0], 0 * known_s, held_s[1]],
            turn[rows],
            offset[rows],
        )
        at_s = np.clip(time_s, known_s[0], known_s[-1])
        after = np.clip(np.searchsorted(known_s, at_s), 1, len(known_s) - 1)
        part = (at_s - known_s[after - 1]) / (known_s[after] - known_s[after - 1])
        place = (1.0 - part[:, None]) * offset[after - 1] + part[:, None] * offset[after]
        unknown = (_moves(turn, offset) & (np.diff(known_s) > LONGEST_GAP_S))[after - 1]
        place[unknown | (time_s < known_s[0]) | (time_s > known_s[-1])] = np.nan
        return between(turn[after - 1], turn[after], part), place

    def _known(
        self,
        edge: tuple[str, str],
        heard_s: tuple[float, float] = _ALWAYS,
        asked_s: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times, turns and offsets of an edge in order of time; of two at one time the last one.

        Args:
            edge: child and parent.
            heard_s: see `placed`.
            asked_s: only those around these times, two on each side; None: all.
        """
        child, parent = edge
        samples = np.asarray(self._samples[child][parent]).reshape(-1, _COLUMNS)
        stamped = 1 if samples[:, 1].any() else 0
        samples = samples[(heard_s[0] <= samples[:, 0]) & (samples[:, 0] <= heard_s[1])][::-1]
        known_s, rows = np.unique(samples[:, stamped], return_index=True)
        if asked_s is not None and len(asked_s):
            first, last = np.searchsorted(known_s, (asked_s.min(), asked_s.max()))
            near = slice(max(first - 2, 0), last + 2)
            known_s, rows = known_s[near], rows[near]
        return known_s, normalised(samples[rows, 5:]), samples[rows, 2:5]


def _moves(turn: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Between which poses a frame moves. [S - 1] bool."""
    if len(offset) < 2:
        return np.zeros(0, bool)
    far = np.linalg.norm(np.diff(offset, axis=0), axis=1) > _SAME_M
    return np.asarray(far | (angle_rad(composed(turn[1:], inverse(turn[:-1]))) > _SAME_RAD))
