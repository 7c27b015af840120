"""The people of one message: their ids and positions, the time and the frame."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.errors import brief
from pedpred.ros.people import PeopleFields, class_of, id_of, people_of, positions_of
from pedpred.ros.tf import frame_name
from pedpred.scenes import rule_of
from pedpred.scenes.people import PERSON_CLASSES, is_person


@dataclass(frozen=True)
class DetectionFrame:
    """The people of one message.

    Attributes:
        time_ns: stamp of the message, or the time of its arrival where it has none.
        frame: of the positions, without a leading slash; empty where the message names none.
        ids: as text, empty where the message has none. [N]
        positions: m; NaN where unknown. [N, 3]
        others: classes of the detections that are not people, and are left out.
        is_stamped: whether the message has a stamp.
    """

    time_ns: int
    frame: str
    ids: tuple[str, ...]
    positions: np.ndarray
    others: tuple[str, ...] = ()
    is_stamped: bool = True

    @property
    def time_s(self) -> float:
        """The stamp, s; exactly as `scene_messages.seconds` has it, since transforms are found by it."""
        return self.time_ns // 10**9 + self.time_ns % 10**9 / 1e9

    @classmethod
    def from_message(
        cls,
        message: Any,
        fields: PeopleFields,
        received_ns: int,
        classes: Collection[str] = PERSON_CLASSES,
    ) -> DetectionFrame:
        """Take people from a decoded message.

        Args:
            message: decoded.
            fields: where its people are.
            received_ns: when it arrived.
            classes: who is a person, where detections have classes.

        Raises:
            ValueRuleError: a field is not there, or not what it must be.
        """
        detected = people_of(message, fields)
        labels = [class_of(one, fields) for one in detected]
        chosen = {label for label in set(labels) if is_person(label, classes)}
        people = [one for one, label in zip(detected, labels, strict=True) if label in chosen]
        others = tuple(label for label in labels if label not in chosen)
        headers = [one.header for one in (message, *detected[:1]) if hasattr(one, "header")]
        frame = next((each.frame_id for each in headers if each.frame_id), "")
        time_ns = headers[0].stamp.sec * 10**9 + headers[0].stamp.nanosec if headers else 0
        ids = tuple(id_of(one, fields) for one in people)
        positions = positions_of(people, fields)
        return cls(time_ns or received_ns, frame_name(frame), ids, positions, others, time_ns != 0)


def find_usable(
    time_s: np.ndarray, track_id: np.ndarray, position: np.ndarray, name: Callable[[int], object] = int
) -> tuple[np.ndarray, str]:
    """Find detections that have a position, and of several of one track in one instant the first.

    Args:
        time_s: s. [M]
        track_id: [M] int64
        position: m. [M, 2]
        name: of a track, for the text.

    Returns:
        [M] bool, and what is wrong with the others, with time and track; empty if there are none.
    """
    placed = rule_of("position", position)[1].all(axis=1)
    order = np.lexsort((~placed, track_id, time_s))  # stable: the first one of several comes first
    again = np.zeros(len(order), bool)
    again[order[1:]] = (np.diff(time_s[order]) == 0) & (np.diff(track_id[order]) == 0)
    unusable = {"without a position": ~placed, "of a track that has one at that time": placed & again}
    texts = [
        f"{rows.sum()} {what}, the first at {time_s[rows][0]} s (track {brief(name(int(track_id[rows][0])))})"
        for what, rows in unusable.items()
        if rows.any()
    ]
    return placed & ~again, f"left out of {len(order)} detections: {'; '.join(texts)}" if texts else ""
