"""People of one message, until the node reads DetectionFrame."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.ros.frame_tree import frame_name
from pedpred.ros.headers import by_header
from pedpred.ros.old_people import ADAPTERS, LABELLED, labels_of
from pedpred.scenes import rule_of
from pedpred.scenes.people import PERSON_CLASSES, is_person


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


def _seconds(time_ns: int) -> float:
    """As `scene_messages.seconds` of a stamp, to the last bit: transforms are found by these times, s."""
    return time_ns // 10**9 + time_ns % 10**9 / 1e9
