"""Messages of people and transforms: people wait until the transforms of their time have arrived."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.ros.detections import DetectionFrame
from pedpred.ros.message_types import TRANSFORMS
from pedpred.ros.people import PEOPLE_FIELDS, parse_fields
from pedpred.ros.tf import Frames
from pedpred.ros2.counts import Counts
from pedpred.ros2.settings import NodeSettings
from pedpred.ros2.wire import decode

KEPT_S = 10.0
"""How long transforms are kept, s."""
_MOST_WAITING = 100
_CAUGHT_UP = 0.1
"""Once people had to wait too long, messages are left out until one waits less than this share of that time:
when forecasts take longer than the interval between messages, late messages would be late for ever."""
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Arrival:
    """A message of people and its times.

    Attributes:
        detected: the people.
        arrived_s: when the message came into the middleware's queue, s.
        read_s: when it was read from there, s.
        clock_ns: the clock of the stamps at that moment.
        time_ns: stamp of its forecast.
    """

    detected: DetectionFrame
    arrived_s: float
    read_s: float
    clock_ns: int
    time_ns: int


class Inbox:
    """Queue of the messages of people.

    Args:
        settings: of the node; may be replaced.
        counts: takes what is left out.
        decode_people: makes a message from bytes; None: by the definition that is known of `people_type`.

    Attributes:
        frames: transforms of the last `KEPT_S`.
        has_ids: whether the type of the messages has ids.
        read_s: when the last message was read, s.
        stamp_age_s: by how much its people were older than the clock of their stamps when they came.
    """

    def __init__(
        self,
        settings: NodeSettings,
        counts: Counts,
        decode_people: Callable[[bytes], Any] | None = None,
    ):
        self.settings, self.frames, self._counts = settings, Frames(kept_s=KEPT_S), counts
        kind = settings.people_type
        self._fields = parse_fields(settings.people_fields) if settings.people_fields else PEOPLE_FIELDS[kind]
        self.has_ids = bool(self._fields.id)
        self._decode_people = decode_people or (lambda raw: decode(raw, kind))
        self._waiting: deque[Arrival] = deque()
        self._is_behind = False
        self.read_s, self.stamp_age_s = -np.inf, 0.0

    @property
    def is_waiting(self) -> bool:
        """Whether people wait for a transform."""
        return bool(self._waiting)

    def take_transforms(self, raw: bytes, clock_s: float, fixed: bool) -> None:
        """Take a tf2_msgs/TFMessage; `fixed` if it is of /tf_static."""
        self.frames.add(decode(raw, TRANSFORMS), clock_s, fixed)

    def take_people(self, raw: bytes, clock_ns: int, now_s: float, waited_s: float = 0.0) -> None:
        """Take people, who wait for the transform of their time.

        Args:
            raw: the message.
            clock_ns: the clock of the stamps now, for people without one.
            now_s: of a clock that never stops or jumps, s.
            waited_s: how long the message lay in a queue, s; people without a stamp are of the time before.
        """
        self._counts.messages += 1
        self.read_s = now_s
        self._is_behind = waited_s > self.settings.max_wait_s * (_CAUGHT_UP if self._is_behind else 1.0)
        if self._is_behind:
            self._counts.slow += 1
            text = "left out: people of %.1f s ago. Forecasts take too long: send fewer people, or less often"
            _log.warning(text, waited_s)
            return
        received_ns = max(clock_ns - round(waited_s * 1e9), 0)
        with self._counts.count_errors():
            detected = DetectionFrame.from_message(
                self._decode_people(raw), self._fields, received_ns, self.settings.class_ids
            )
        self._counts.detections += len(detected.ids)
        self._counts.others += len(detected.others)
        if detected.others:
            text = "left out: detections of class %s; parameter class_ids names the classes of people"
            _log.info(text, sorted(set(detected.others)))
        if not detected.is_stamped:
            _log.warning("people have no stamp: the time of their arrival is used")
        self.stamp_age_s = (received_ns - detected.time_ns) / 1e9
        if len(self._waiting) >= _MOST_WAITING:  # the first ones stay: their transforms come first
            self._counts.lost += 1
            _log.warning("people left out: %d messages wait for transforms", _MOST_WAITING)
            return
        self._waiting.append(Arrival(detected, now_s - waited_s, now_s, clock_ns, detected.time_ns))

    def ready(self, now_s: float, target: str) -> Iterator[Arrival]:
        """Messages whose transforms have arrived; those that have waited too long are left out.

        Args:
            now_s: as that of `take_people`.
            target: frame to which transforms are needed.
        """
        while self._waiting:
            first = self._waiting[0]
            detected, timeout_s = first.detected, self.settings.transform_timeout_s
            missing = ""
            if detected.ids:
                missing = self.frames.explain_missing(detected.frame, target, detected.time_s)
            if missing and now_s - first.read_s < timeout_s:
                return
            self._waiting.popleft()
            if missing:
                self._counts.lost += 1
                _log.warning("people in %r left out: %s (waited %s s)", detected.frame, missing, timeout_s)
            else:
                yield first

    def clear(self) -> None:
        """Leave out the people who wait."""
        self._waiting.clear()
