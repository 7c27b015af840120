"""Messages of tracked people -> detections; those without a place, and doubles, are counted."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from pedpred.errors import brief
from pedpred.ros.frame_tree import frame_name
from pedpred.scenes import rule_of

Adapter = Callable[[Any], Iterator[tuple[object, Any]]]
"""A message -> (name, position with x and y in m) of every person in it."""

_LARGEST = 2**63 - 1
_MOST_DIGITS = len(str(_LARGEST))
_ROBOT = 2
"""The type of a robot among the agents of pedsim and of HuNavSim."""


def _agents(agents: Any, position: Callable[[Any], Any]) -> Iterator[tuple[object, Any]]:
    """Agents of a simulator, without its robot."""
    return ((agent.id, position(agent)) for agent in agents if getattr(agent, "type", 0) != _ROBOT)


def _place_of_box(detection: Any) -> Any:
    """The centre of a vision_msgs/Detection3D; where that is not filled in, where its likeliest class is."""
    centre = detection.bbox.center.position
    scores = [each.score for each in _hypotheses(detection)]
    if not scores or any((centre.x, centre.y, centre.z)):
        return centre
    return detection.results[int(np.argmax(scores))].pose.pose.position


ADAPTERS: dict[str, Adapter] = {
    "people_msgs/msg/People": lambda m: ((p.name, p.position) for p in m.people),
    "people_msgs/msg/PositionMeasurementArray": lambda m: ((p.object_id, p.pos) for p in m.people),
    "spencer_tracking_msgs/msg/TrackedPersons": lambda m: (
        (t.track_id, t.pose.pose.position) for t in m.tracks
    ),
    "hunav_msgs/msg/Agents": lambda m: _agents(m.agents, lambda agent: agent.position.position),
    "pedsim_msgs/msg/AgentStates": lambda m: _agents(m.agent_states, lambda agent: agent.pose.position),
    "vision_msgs/msg/Detection3DArray": lambda m: (
        (getattr(d, "id", getattr(d, "tracking_id", "")), _place_of_box(d)) for d in m.detections
    ),
    # poses have no names: the place in the list identifies the person
    "geometry_msgs/msg/PoseArray": lambda m: ((place, pose.position) for place, pose in enumerate(m.poses)),
}
"""The supported message types. All have a header with stamp and frame."""

LABELLED = "vision_msgs/msg/Detection3DArray"
"""The one whose detections have classes."""

_WITH_HEADERS = {"people_msgs/msg/PositionMeasurementArray": "people", LABELLED: "detections"}
"""The types whose people have headers of their own, and the field of these people."""
_NOBODY, _NEGATIVE = "-1", re.compile(r"-\d+")
"""What trackers call whom they do not follow, as they do by NaN and by no id; and any negative number."""


def stamp_and_frames(message: Any, kind: str) -> tuple[Any, str, tuple[str, ...]]:
    """Stamp and frame of a message of people, and the other frames that its people name themselves.

    Where the message's header lacks one, it is that of the people's own headers, if they agree.
    """
    stamp, frame = message.header.stamp, frame_name(message.header.frame_id)
    headers = [one.header for one in getattr(message, _WITH_HEADERS[kind])] if kind in _WITH_HEADERS else []
    named = {name for each in headers if (name := frame_name(each.frame_id))}
    if not frame and len(named) == 1:
        frame = named.pop()
    if not (stamp.sec or stamp.nanosec):
        stamp = next((each.stamp for each in headers if each.stamp.sec or each.stamp.nanosec), stamp)
    return stamp, frame, tuple(sorted(named - {frame}))


class Nameless:
    """Tells ids that mean nobody: empty ones, NaN, and -1 unless others are negative, as in tables."""

    def __init__(self) -> None:
        self._some_are_negative = False

    def note(self, ids: Iterable[str]) -> None:
        """Look for other negative ids."""
        self._some_are_negative |= any(one != _NOBODY and _NEGATIVE.fullmatch(one) for one in ids)

    def named(self, ids: Iterable[str]) -> tuple[str, ...]:
        """The ids, where those that mean nobody are empty."""
        nobody = {"nan"} if self._some_are_negative else {"nan", _NOBODY}
        return tuple("" if one.lower() in nobody else one for one in ids)


def labels_of(message: Any) -> list[str]:
    """The likeliest class of each detection of a vision_msgs/Detection3DArray; empty where it has none."""
    likely = [max(_hypotheses(one), key=lambda each: each.score, default=None) for one in message.detections]
    return ["" if one is None else str(getattr(one, "class_id", getattr(one, "id", ""))) for one in likely]


def _hypotheses(detection: Any) -> list[Any]:
    """Classes with scores, of every edition of the package."""
    return [getattr(result, "hypothesis", result) for result in getattr(detection, "results", ())]


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
