"""Detections of people in a bag: put into one frame and one clock, with ids that say who is who."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError, brief
from pedpred.ros.clocks import find_false, find_missing, find_passes, in_a_row
from pedpred.ros.frame_tree import MAP_FRAME, FrameTree, frame_name, is_robots, lacks_height
from pedpred.ros.frames import Transform, check_frames
from pedpred.ros.headers import by_header
from pedpred.ros.heights import check_heights
from pedpred.ros.identity import check_identity, check_steps
from pedpred.ros.localisation import find_poses, without_jumps
from pedpred.ros.old_people import (
    ADAPTERS,
    LABELLED,
    Nameless,
    TrackNumbers,
    find_usable,
    labels_of,
)
from pedpred.ros.placeholders import find_placeholders, left_out
from pedpred.scenes import Trajectories, rule_of
from pedpred.scenes.people import PERSON_CLASSES, is_person

_CARRIED = re.compile(r"base_|_link|laser|lidar|velodyne|ouster|livox|camera|optical|scan|realsense|zed")
"""In names of frames that robots carry, mostly."""
_TOLD = 5
_APART_S = 1.5
"""Stamps of people and transforms that come together differ by less: a localisation stamps poses up to 1 s
ahead, and detectors take their time."""
_JUMPING = 0.2
"""A robot's frame jumps in a smaller share of its steps, where its localisation corrects itself."""
_ROBOT_REMEDY = "a robot's frame moves: record /tf up to the map's frame too"


@dataclass(frozen=True)
class Instant:
    """People who were seen at one time in one frame: those of one message, mostly.

    Attributes:
        stamp_s: when, s.
        received_s: when the bag received the message, s.
        frame: of the places, without a leading slash.
        ids: who.
        place: where, m; what is unknown is NaN. [n, 3]
        others: classes of the detections that are not people, and are left out.
        time_ns: when, ns.
        array_frame: the frame that the message names, where the headers of its detections name another one.
        part: how many instants of the same message come before.
    """

    stamp_s: float
    received_s: float
    frame: str
    ids: tuple[str, ...]
    place: np.ndarray
    others: tuple[str, ...] = ()
    time_ns: int = 0
    array_frame: str = ""
    part: int = 0

    @classmethod
    def all_of(
        cls, message: Any, kind: str, received_s: float, classes: Collection[str] = PERSON_CLASSES
    ) -> list[Instant]:
        """Take what counts of a decoded message; of a place, what is no number or absurd is NaN.

        Args:
            message: decoded.
            kind: its type.
            received_s: when the bag received it, s.
            classes: who is a person, where detections have classes.

        Returns:
            One for each time and frame of its detections, see `by_header`; of nobody if it has none.
        """
        detected = list(ADAPTERS[kind](message))
        labels = labels_of(message) if kind == LABELLED else [""] * len(detected)
        instants: list[Instant] = []
        for time_ns, frame, rows in by_header(message.header, [one.header for one in detected]):
            others = tuple(labels[row] for row in rows if not is_person(labels[row], classes))
            people = [detected[row] for row in rows if is_person(labels[row], classes)]
            at = [(one.position.x, one.position.y, one.position.z) for one in people]
            place = np.array(at, np.float64).reshape(-1, 3)
            place = np.where(rule_of("position", place)[1], place, np.nan)
            ids, outer = tuple(str(one.name) for one in people), frame_name(message.header.frame_id)
            another, part = outer if outer != frame else "", len(instants)
            seen = cls(_seconds(time_ns), received_s, frame, ids, place, others, time_ns, another, part)
            instants.append(seen)
        return instants


class People:
    """All messages of a bag's people, in the order in which it received them.

    Args:
        instants: the messages.
        warn: is told what is left out or changed.
    """

    def __init__(self, instants: Sequence[Instant], warn: Callable[[str], object]):
        self._warn = warn
        self._tell_others(instants)
        self._tell_frames(instants)
        stamp_s = np.array([each.stamp_s for each in instants], np.float64)
        received_s = np.array([each.received_s for each in instants], np.float64)
        if received_s.any() and _stands_still(instants):
            lack = "most stamps are those of the message before" if stamp_s.any() else "all stamps are zero"
            warn(f"{lack}, so times are those at which the bag was written")
            stamp_s = received_s
        missing = find_missing(stamp_s)
        if missing.any():
            warn(f"left out: {missing.sum()} of {len(missing)} messages, which have no stamp")
        false = np.zeros(len(stamp_s), bool)
        false[~missing] = find_false(stamp_s[~missing])
        if false.any():
            first = stamp_s[false][0]
            text = f"left out: {false.sum()} of {len(false)} messages, whose stamps jump away and back"
            warn(f"{text}, the first at {first} s")
        kept = ~(missing | false)
        self._instants = [each for each, sound in zip(instants, kept, strict=True) if sound]
        self._stamp_s, self._received_s = stamp_s[kept], received_s[kept]
        self._message = np.cumsum([each.part == 0 for each in instants])[kept]
        self._passes = find_passes(self._stamp_s)
        self._time_s = in_a_row(self._stamp_s, self._passes)
        if back := int(self._passes.max(initial=0)):
            first = self._stamp_s[np.argmax(self._passes > 0)]
            warn(f"time goes back {back} times, first to {first} s: what follows comes later, with other ids")

    def _tell_others(self, instants: Sequence[Instant]) -> None:
        """Tell which classes are left out.

        Raises:
            ValueRuleError: nobody is left.
        """
        others = Counter(label for each in instants for label in each.others)
        if others and not any(each.ids for each in instants):
            rule = "none is a class of people: name the one that is (--class)"
            raise ValueRuleError("class_id", dict(others), rule)
        if others:
            listed = ", ".join(f"{count} of {label!r}" for label, count in others.most_common(_TOLD))
            self._warn(f"left out: detections that are not people, {listed}")

    def _tell_frames(self, instants: Sequence[Instant]) -> None:
        """Tell where frames are not named, or where messages and their detections name different ones."""
        numbers = np.cumsum([each.part == 0 for each in instants]).tolist()
        pairs = zip(numbers, instants, strict=True)
        seen = dict.fromkeys((number, each.array_frame, each.frame) for number, each in pairs if each.ids)
        if nowhere := sum(not frame for _, _, frame in seen):
            text = f"{nowhere} of {len({number for number, *_ in seen})} messages name no frame"
            lack = "(header.frame_id is empty): their places count as they are"
            self._warn(f"{text} {lack}, so give the frame if the robot moves")
        differ = Counter((outer, inner) for _, outer, inner in seen if outer)
        for (outer, inner), count in differ.most_common(_TOLD):
            text = f"{count} messages are in {outer!r}, and the headers of their detections in {inner!r}"
            self._warn(f"{text}, which counts: correct these headers if places are in {outer!r}")

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
            ValueRuleError: people and map are in different frames, and how they lie is unknown, or another
                axis than z looks like the height.
        """
        # the frame of a message of nobody says nothing
        frames = {each.frame for each in self._instants if each.ids}
        tree = FrameTree() if frames <= {grid or MAP_FRAME} else transforms()
        targets = {frame: _target(frame, grid, tree, transform) for frame in frames}
        check_frames(set(targets.values()), grid, transform)
        for frame in frames - {grid}:
            if _CARRIED.search(targets[frame]) and transform is None:
                self._warn(f"people are in {frame!r}, and nothing says how that moves: {_ROBOT_REMEDY}")
        placed = self._placed(tree, targets)
        everybody = np.concatenate([np.zeros((0, 3)), *placed])
        known: dict[str, int] = {}
        who = [known.setdefault(name, len(known)) for each in self._instants for name in each.ids]
        check_heights(
            everybody, np.array(who, np.int64), ", ".join(sorted(set(targets.values()))), self._warn
        )
        placed = [places[:, :2] for places in placed]
        return placed if transform is None else [transform.to_map(places) for places in placed]

    def _placed(self, tree: FrameTree, targets: dict[str, str]) -> list[np.ndarray]:
        """The places of each message in the target of its frame, m. [n, 3] each."""
        result = [each.place for each in self._instants]
        for frame, target in targets.items():
            for number in range(int(self._passes.max(initial=0)) + 1) if frame != target else ():
                here = self._passes == number
                rows = [row for row in np.flatnonzero(here) if self._instants[row].frame == frame]
                counts = [len(result[row]) for row in rows]
                if not sum(counts):
                    continue
                time_s = self._stamp_s[rows].repeat(counts)
                places = np.concatenate([result[row] for row in rows])
                moved = tree.placed(places, time_s, frame, target, self._heard(here))
                self._doubt_transforms(tree, (frame, target), rows)
                lost = np.isnan(moved).all(axis=1) & np.isfinite(places[:, :2]).all(axis=1)
                if lost.any():
                    text = f"{lost.sum()} of {len(lost)} detections, for which no /tf leads from {frame!r} to"
                    self._warn(f"left out: {text} {target!r}, the first at {time_s[lost][0]} s")
                if lost.all():
                    rule = f"/tf must lead from {frame!r} to {target!r} at that time: record both together"
                    raise ValueRuleError("transform", f"none at {time_s[0]} s", rule)
                if flat := lacks_height(moved).sum():
                    self._warn(f"left out: {flat} detections without a height in {frame!r}, which is tilted")
                frames, heard_s = (frame, target), self._heard(here)
                moved[:, :2] = self._without_jumps(tree, frames, time_s, moved[:, :2], heard_s)
                for row, part in zip(rows, np.split(moved, np.cumsum(counts)[:-1]), strict=True):
                    result[row] = part
        return result

    def _doubt_transforms(self, tree: FrameTree, frames: tuple[str, str], rows: list[Any]) -> None:
        """Tell where transforms jump, or have stamps of another time than people that come with them."""
        child, parent, count, steps = tree.jumps(*frames)
        if count > _JUMPING * steps:
            ask = "do two nodes publish them, or two robots with the same names of frames?"
            self._warn(f"the poses of {child!r} in {parent!r} jump in {count} of {steps} steps: {ask}")
        child, parent, lag_s = tree.lag_s(*frames, self._stamp_s[rows], self._received_s[rows])
        if abs(lag_s) > _APART_S:
            text = f"stamped {abs(lag_s):.1f} s {'later' if lag_s > 0 else 'earlier'} than the poses of"
            ask = (
                "are the clocks of two computers apart? People are placed where the robot was at other times"
            )
            self._warn(f"people are {text} {child!r} in {parent!r} that come with them: {ask}")

    def _without_jumps(
        self,
        tree: FrameTree,
        frames: tuple[str, str],
        time_s: np.ndarray,
        place: np.ndarray,
        heard_s: tuple[float, float],
    ) -> np.ndarray:
        """Places at some times so that nobody runs where the localisation jumps. [M, 2], of [M], [M, 2]."""
        instants_s, instant = np.unique(time_s, return_inverse=True)
        poses = find_poses(tree, *frames, instants_s, heard_s)
        if poses is None:
            return place
        order = np.argsort(instant, kind="stable")
        corrected, jump_m = np.empty_like(place), np.zeros(0)
        corrected[order], jump_m = without_jumps(poses, instant[order], place[order])
        if len(jump_m):
            text = f"the localisation has moved {poses.frame!r} in {frames[1]!r} {len(jump_m)} times at once"
            self._warn(f"{text}, people by up to {jump_m.max():.2g} m: their places before lead there")
        return corrected

    def _heard(self, here: np.ndarray) -> tuple[float, float]:
        """When transforms were received that belong to one pass: up to the neighbouring passes, s."""
        rows = np.flatnonzero(here)
        before, after = rows[0] - 1, rows[-1] + 1
        first = self._received_s[before] if before >= 0 else -np.inf
        return first, self._received_s[after] if after < len(here) else np.inf

    def trajectories(
        self, position: Sequence[np.ndarray], names: dict[int, str] | None = None
    ) -> Trajectories:
        """The tracks of all people.

        Args:
            position: of the people in each message, m; NaN where nobody knows. [n, 2] each
            names: takes those of tracks whose numbers are not their names: number -> name.

        Raises:
            ValueRuleError: ids do not say who is who.
        """
        read = [each.place[:, :2] for each in self._instants]
        ids, position, read = self._named([each.ids for each in self._instants], position, read)
        check_identity(*self._of_messages(ids, position))
        numbers, counts = TrackNumbers(), [len(each) for each in ids]
        called = [
            f"{name} ({number + 1})" if number else name  # after time has gone back
            for each, number in zip(ids, self._passes.tolist(), strict=True)
            for name in each
        ]
        track_id = np.array([numbers.number(name) for name in called], np.int64)
        own = {n: name for n, name in zip(track_id.tolist(), called, strict=True) if n < 0}
        if names is not None:
            names.update(own)
        time_s = self._time_s.repeat(counts)
        places = np.concatenate([np.zeros((0, 2)), *position])
        kept, lack = find_usable(time_s, track_id, places, lambda track: own.get(track, track))
        if lack:
            self._warn(lack)
        written = np.concatenate([np.zeros((0, 2)), *read])
        unknown = find_placeholders(time_s[kept], track_id[kept], places[kept], written[kept])
        if unknown.any():
            self._warn(left_out(written[kept][unknown], len(unknown)))
            kept[kept] = ~unknown
        people = Trajectories(time_s[kept], track_id[kept], places[kept])
        check_steps(people)
        return people

    def _of_messages(
        self, ids: list[tuple[str, ...]], position: list[np.ndarray]
    ) -> tuple[list[tuple[str, ...]], np.ndarray, list[np.ndarray]]:
        """Ids, time and places of each message, which may be several instants; m. [n, 2] each."""
        first = np.flatnonzero(np.diff(self._message, prepend=-1))
        if len(first) == len(ids):
            return ids, self._time_s, position
        parts = [slice(*ends) for ends in pairwise([*first.tolist(), len(ids)])]
        together = [tuple(name for each in ids[part] for name in each) for part in parts]
        last = [part.stop - 1 for part in parts]
        return together, self._time_s[last], [np.concatenate(position[part]) for part in parts]

    def _named(
        self, ids: list[tuple[str, ...]], *places: Sequence[np.ndarray]
    ) -> tuple[list[tuple[str, ...]], list[np.ndarray], list[np.ndarray]]:
        """Those who have an id, unless nobody has, and their places in two frames."""
        nameless = Nameless()
        nameless.note_all(ids)
        known = [nameless.named(each) for each in ids]
        named = [np.array([bool(name) for name in each], bool) for each in known]
        count = sum(int(there.sum()) for there in named)
        if lack := sum(map(len, ids)) - count if count else 0:
            pairs = zip(ids, named, strict=True)
            written = {name for each, there in pairs for name in np.array(each, object)[~there]}
            text = f"left out: {lack} of {lack + count} detections, which have no id"
            self._warn(f"{text}: {brief(sorted(written))}")
            known = [tuple(name for name in each if name) for each in known]
            places = tuple([at[there] for at, there in zip(each, named, strict=True)] for each in places)
        position, read = places
        return known, list(position), list(read)


def _seconds(time_ns: int) -> float:
    """As `scene_messages.seconds` of a stamp, to the last bit: transforms are found by these times, s."""
    return time_ns // 10**9 + time_ns % 10**9 / 1e9


def _stands_still(instants: Sequence[Instant]) -> bool:
    """Whether most messages have the stamp of the one before, and people in common with it."""
    pairs = [(one, other) for one, other in pairwise(instants) if set(one.ids) & set(other.ids)]
    return 2 * sum(one.stamp_s == other.stamp_s for one, other in pairs) > len(pairs)


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
    if tree.moves(frame) or is_robots(above[-1]):
        frames = f"people in {frame!r}, which /tf brings to {above[-1]!r}, map in {grid!r}"
        rule = f"nothing says how these lie: {_ROBOT_REMEDY}, or leave the bag's maps out (--map-topic '')"
        raise ValueRuleError("frame_id", frames, rule)
    return frame
