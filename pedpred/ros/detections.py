"""Detections of people in a bag: put into one frame and one clock, with ids that say who is who."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.ros.clocks import find_false, find_passes, in_a_row
from pedpred.ros.frame_tree import MAP_FRAME, FrameTree, frame_name
from pedpred.ros.frames import Transform, check_frames
from pedpred.ros.identity import check_identity
from pedpred.ros.people import ADAPTERS, TrackNumbers, find_usable
from pedpred.ros.scene_messages import seconds
from pedpred.scenes import Trajectories, rule_of

_ROBOTS = ("base_link", "base_footprint")
"""Frames of robots (REP 105): they move."""
_ROBOT_REMEDY = "a robot's frame moves: record /tf up to the map's frame too"


@dataclass(frozen=True)
class Instant:
    """One message of people.

    Attributes:
        stamp_s: of its header, s.
        received_s: when the bag received it, s.
        frame: of the places, without a leading slash.
        ids: who.
        place: where, m. [n, 3]
    """

    stamp_s: float
    received_s: float
    frame: str
    ids: tuple[str, ...]
    place: np.ndarray

    @classmethod
    def of(cls, message: Any, kind: str, received_s: float) -> Instant:
        """Take what counts of a decoded message; an unknown height is 0, and a place without numbers NaN."""
        people = list(ADAPTERS[kind](message))
        place = np.array([(at.x, at.y, at.z) for _, at in people], np.float64).reshape(-1, 3)
        possible = rule_of("position", place)[1]
        place = np.where(possible, place, [np.nan, np.nan, 0.0])
        header = message.header
        ids = tuple(str(name) for name, _ in people)
        return cls(seconds(header.stamp), received_s, frame_name(header.frame_id), ids, place)


class People:
    """All messages of a bag's people, in the order in which it received them.

    Args:
        instants: the messages.
        warn: is told what is left out or changed.
    """

    def __init__(self, instants: Sequence[Instant], warn: Callable[[str], object]):
        stamp_s = np.array([each.stamp_s for each in instants], np.float64)
        received_s = np.array([each.received_s for each in instants], np.float64)
        if received_s.any() and not stamp_s.any():
            warn("all stamps are zero, so times are those at which the bag was written")
            stamp_s = received_s
        false = find_false(stamp_s)
        if false.any():
            first = stamp_s[false][0]
            warn(f"{false.sum()} messages left out, whose stamps jump away and back, the first at {first} s")
        self._warn = warn
        self._instants = [each for each, bad in zip(instants, false, strict=True) if not bad]
        self._stamp_s, self._received_s = stamp_s[~false], received_s[~false]
        self._passes = find_passes(self._stamp_s)
        self._time_s = in_a_row(self._stamp_s, self._passes)
        if back := int(self._passes.max(initial=0)):
            first = self._stamp_s[np.argmax(self._passes > 0)]
            warn(f"time goes back {back} times, first to {first} s: what follows comes later, with other ids")

    def in_one_frame(
        self, grid: str | None, transform: Transform | None, transforms: Callable[[], FrameTree]
    ) -> list[np.ndarray]:
        """The places of each message in the frame of the map.

        Args:
            grid: the map's frame; None without a map.
            transform: of the people's frame in the map's; of a frame that moves, of the topmost one.
            transforms: reads /tf; called where people are not in the map's frame.

        Returns:
            m, NaN where a transform is missing. [n, 2] each

        Raises:
            ValueRuleError: people and map are in different frames, and how they lie is unknown.
        """
        frames = {each.frame for each in self._instants}
        tree = FrameTree() if frames <= {grid or MAP_FRAME} else transforms()
        targets = {frame: _target(frame, grid, tree, transform) for frame in frames}
        check_frames(set(targets.values()), grid, transform)
        for frame in frames - {grid}:
            if targets[frame].rpartition("/")[2] in _ROBOTS and transform is None:
                self._warn(f"people are in {frame!r}, and nothing says how that moves: {_ROBOT_REMEDY}")
        found = self._placed(tree, targets)
        return found if transform is None else [transform.to_map(places) for places in found]

    def _placed(self, tree: FrameTree, targets: dict[str, str]) -> list[np.ndarray]:
        """The places of each message in the target of its frame. [n, 2] each."""
        found = [each.place for each in self._instants]
        for frame, target in targets.items():
            for number in range(int(self._passes.max(initial=0)) + 1) if frame != target else ():
                own = self._passes == number
                rows = [row for row in np.flatnonzero(own) if self._instants[row].frame == frame]
                counts = [len(found[row]) for row in rows]
                if not sum(counts):
                    continue
                time_s = self._stamp_s[rows].repeat(counts)
                places = np.concatenate([found[row] for row in rows])
                moved = tree.placed(places, time_s, frame, target, self._heard(own))
                lost = np.isnan(moved).any(axis=1) & np.isfinite(places).all(axis=1)
                if lost.any():
                    text = f"{lost.sum()} of {len(lost)} detections, for which no /tf leads from {frame!r} to"
                    self._warn(f"left out: {text} {target!r}, the first at {time_s[lost][0]} s")
                if lost.all():
                    rule = f"/tf must lead from {frame!r} to {target!r} at that time: record both together"
                    raise ValueRuleError("transform", f"none at {time_s[0]} s", rule)
                for row, part in zip(rows, np.split(moved, np.cumsum(counts)[:-1]), strict=True):
                    found[row] = part
        return [places[:, :2] for places in found]

    def _heard(self, own: np.ndarray) -> tuple[float, float]:
        """When transforms were received that belong to one pass: up to the neighbouring passes, s."""
        rows = np.flatnonzero(own)
        before, after = rows[0] - 1, rows[-1] + 1
        first = self._received_s[before] if before >= 0 else -np.inf
        return first, self._received_s[after] if after < len(own) else np.inf

    def trajectories(self, position: Sequence[np.ndarray]) -> Trajectories:
        """The tracks of all people.

        Args:
            position: of the people in each message, m; NaN where nobody knows. [n, 2] each

        Raises:
            ValueRuleError: ids do not say who is who.
        """
        ids = [each.ids for each in self._instants]
        check_identity(ids, self._time_s, position)
        numbers, counts = TrackNumbers(), [len(each) for each in ids]
        track_id = np.array(
            [
                numbers.number((name, int(number)) if number else name)
                for each, number in zip(ids, self._passes, strict=True)
                for name in each
            ],
            np.int64,
        )
        time_s = self._time_s.repeat(counts)
        places = np.concatenate([np.zeros((0, 2)), *position])
        kept, left_out = find_usable(time_s, track_id, places)
        if left_out:
            self._warn(left_out)
        return Trajectories(time_s[kept], track_id[kept], places[kept])


def _target(frame: str, grid: str | None, tree: FrameTree, transform: Transform | None) -> str:
    """The frame into which people are brought: the map's, or the topmost one where that is unknown.

    Raises:
        ValueRuleError: people are in a robot's frame, and nothing says where that is in the map's; or in one
            that moves, and a fixed transform is given.
    """
    above = tree.chain(frame)
    reached = grid is not None and tree.chain(grid)[-1] == above[-1]
    if transform is not None:
        if reached and tree.moves(frame):
            rule = f"{frame!r} moves, as /tf says, and /tf leads to {grid!r}: leave --transform out"
            raise ValueRuleError("transform", vars(transform), rule)
        return above[-1] if tree.moves(frame) else frame
    if reached:
        return str(grid)
    if grid is None:
        return MAP_FRAME if MAP_FRAME in above else above[-1]
    if tree.moves(frame) or above[-1].rpartition("/")[2] in _ROBOTS:
        found = f"people in {frame!r}, which /tf brings to {above[-1]!r}, map in {grid!r}"
        rule = f"nothing says how these lie: {_ROBOT_REMEDY}, or leave the bag's maps out (--map-topic '')"
        raise ValueRuleError("frame_id", found, rule)
    return frame
