"""Messages of tracked people -> detections; those without a place, and doubles, are counted."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from pedpred.errors import brief
from pedpred.scenes import rule_of


class Detected(NamedTuple):
    """One person in a message.

    Attributes:
        name: who.
        position: with x, y and z in m.
        header: of this detection alone; None where the type has none.
    """

    name: object
    position: Any
    header: Any = None


Adapter = Callable[[Any], Iterable[Detected]]
"""A message -> every person in it."""

_LARGEST = 2**63 - 1
_MOST_DIGITS = len(str(_LARGEST))
_MINUS_ONE, _NEGATIVE = "-1", re.compile(r"-\d+")
_UNSIGNED = 2**64 - 1
_ROBOT = 2
"""The type of a robot among the agents of pedsim and of HuNavSim."""


def _poses(message: Any) -> Iterator[Detected]:
    """Poses have no names: the index in the list identifies the person."""
    return (Detected(index, pose.position) for index, pose in enumerate(message.poses))


def _agents(agents: Any, position: Callable[[Any], Any]) -> Iterator[Detected]:
    """Agents of a simulator, without its robot."""
    people = (agent for agent in agents if getattr(agent, "type", 0) != _ROBOT)
    return (Detected(_number(agent.id), position(agent), getattr(agent, "header", None)) for agent in people)


def _number(written: int) -> int:
    """An id of 64 bits without a sign, in which -1 is the largest number."""
    return -1 if written == _UNSIGNED else written


def _box(detection: Any) -> Detected:
    """A detection of vision_msgs: in the middle of its box, or at its likeliest pose if that is empty."""
    name = getattr(detection, "id", getattr(detection, "tracking_id", ""))
    position = detection.bbox.center.position
    if not (position.x or position.y or position.z) and (likely := _likeliest(detection)) is not None:
        position = likely.pose.pose.position
    return Detected(name, position, detection.header)


ADAPTERS: dict[str, Adapter] = {
    "people_msgs/msg/People": lambda m: (Detected(p.name, p.position) for p in m.people),
    "people_msgs/msg/PositionMeasurementArray": lambda m: (
        Detected(p.object_id, p.pos, p.header) for p in m.people
    ),
    "spencer_tracking_msgs/msg/TrackedPersons": lambda m: (
        Detected(_number(t.track_id), t.pose.pose.position) for t in m.tracks
    ),
    "hunav_msgs/msg/Agents": lambda m: _agents(m.agents, lambda agent: agent.position.position),
    "pedsim_msgs/msg/AgentStates": lambda m: _agents(m.agent_states, lambda agent: agent.pose.position),
    "vision_msgs/msg/Detection3DArray": lambda m: map(_box, m.detections),
    "geometry_msgs/msg/PoseArray": _poses,
}
"""The supported message types. All have a header with stamp and frame; detections of some have one, too."""

LABELLED = "vision_msgs/msg/Detection3DArray"
"""The one whose detections have classes."""


def labels_of(message: Any) -> list[str]:
    """The likeliest class of each detection of a vision_msgs/Detection3DArray; empty where it has none."""
    likely = [_likeliest(one) for one in message.detections]
    classes = [None if one is None else getattr(one, "hypothesis", one) for one in likely]
    return ["" if one is None else str(getattr(one, "class_id", getattr(one, "id", ""))) for one in classes]


def _likeliest(detection: Any) -> Any | None:
    """The result with the highest score, of every edition of the package; None: there is none."""
    return max(getattr(detection, "results", ()), key=_score, default=None)


def _score(result: Any) -> float:
    return float(getattr(result, "hypothesis", result).score)


class Nameless:
    """Tells ids that mean nobody: empty ones, NaN, and -1 unless others are negative, as in tables."""

    def __init__(self) -> None:
        self._nobody = {"nan", "-nan", _MINUS_ONE}

    def note(self, ids: Iterable[str]) -> None:
        """Look for other negative ids."""
        if any(one != _MINUS_ONE and _NEGATIVE.fullmatch(one) for one in ids):
            self._nobody.discard(_MINUS_ONE)

    def note_all(self, messages: Sequence[Sequence[str]]) -> None:
        """Look at the ids in all messages of a bag: -1 is also somebody where nobody has another id."""
        for each in messages:
            self.note(each)
        if not any(any(self.named(each)) for each in messages):
            self._nobody.discard(_MINUS_ONE)

    def named(self, ids: Iterable[str]) -> tuple[str, ...]:
        """The ids, where those that mean nobody are empty."""
        return tuple("" if one.lower() in self._nobody else one for one in ids)


class TrackNumbers:
    """Track numbers for names: 7 keeps its value; other names, also 007, get -1, -2, ... in order."""

    def __init__(self) -> None:
        self._given: dict[str, int] = {}
        self._next = -1

    def number(self, name: object) -> int:
        """The number of a name, the same on every call, of 64 bits; different names have different ones."""
        text = str(name)
        short = text.isascii() and text.isdecimal() and len(text) <= _MOST_DIGITS
        if short and text == str(int(text)) and int(text) <= _LARGEST:
            return int(text)
        if text not in self._given:
            self._given[text] = self._next
            self._next -= 1
        return self._given[text]

    def forget(self, name: str) -> None:
        """Drop a name; its number is given to no other one, and another one to this name."""
        self._given.pop(name, None)


def find_usable(
    time_s: np.ndarray, track_id: np.ndarray, position: np.ndarray, name: Callable[[int], object] = int
) -> tuple[np.ndarray, str]:
    """Which detections have a place, and of several of one track in one instant are the first.

    Args:
        time_s: s. [M]
        track_id: [M] int64
        position: m. [M, 2]
        name: what a track is called by who reads of it.

    Returns:
        [M] bool, and what is wrong with the others, with time and track; empty if there are none.
    """
    placed = rule_of("position", position)[1].all(axis=1)
    order = np.lexsort((~placed, track_id, time_s))  # stable: the first one of several comes first
    again = np.zeros(len(order), bool)
    again[order[1:]] = (np.diff(time_s[order]) == 0) & (np.diff(track_id[order]) == 0)
    lacks = {"without a place": ~placed, "of a track that was there already": placed & again}
    texts = [
        f"{lack.sum()} {what}, the first at {time_s[lack][0]} s (track {brief(name(int(track_id[lack][0])))})"
        for what, lack in lacks.items()
        if lack.any()
    ]
    return placed & ~again, f"left out of {len(order)} detections: {'; '.join(texts)}" if texts else ""
