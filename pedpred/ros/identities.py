"""Identify the people in a stream of messages, live or in a bag: by ids, or by position."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Sequence
from itertools import chain

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.ros.assignment import NearestTracks
from pedpred.settings import check_choice

MODES = ("auto", "given", "assigned")
_REMEDY = "leave identities at auto, or record the topic of a tracker, such as people_msgs/People with names"
_MESSAGES = 10
"""So many of the last messages decide, in a live stream, whether ids identify people."""
_NEW_SHARE = 0.95
_NO_IDS = ("", "-1", "nan", "-nan")
_LARGEST = 2**63 - 1
_ASSIGNED = "ids are missing, shared, or new in each message: people are identified by position"
_log = logging.getLogger(__name__)


class TrackNumbers:
    """Track numbers for names: 7 keeps its value; other names, also 007, get -1, -2, ... in order."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}
        self._next = -1

    def number(self, name: object) -> int:
        """The number of a name, the same on every call, of 64 bits; different names have different ones."""
        text = str(name)
        is_short = text.isascii() and text.isdecimal() and len(text) <= len(str(_LARGEST))
        if is_short and text == str(int(text)) and int(text) <= _LARGEST:
            return int(text)
        if text not in self._numbers:
            self._numbers[text] = self._next
            self._next -= 1
        return self._numbers[text]

    def forget(self, name: str) -> None:
        """Drop a name; its number is not used again."""
        self._numbers.pop(name, None)


def are_identities(messages: Sequence[Sequence[str]]) -> bool:
    """Whether ids identify people from one message to the next.

    Args:
        messages: the ids in each, empty where there is none; messages without people do not count.

    Returns:
        False if most messages have no ids, or one for several people, or if nearly all ids are in one
        message only.
    """
    named = [list(filter(None, ids)) for ids in messages if len(ids)]
    unclear = sum(not ids or len(set(ids)) < len(ids) for ids in named)
    if 2 * unclear > len(named):
        return False
    count = sum(len(set(ids)) for ids in named)
    new = len(set(chain.from_iterable(named)))
    return len(named) < _MESSAGES or new <= _NEW_SHARE * count


class Identities:
    """Numbers the people of one stream, message by message in order of time.

    People without an id, among others who have one, are assigned by position. They are named #1, #2, ...

    Args:
        mode: given: by ids. assigned: by position, which gives 1, 2, ... auto: by ids while these identify
            people, see `are_identities`.
        has_ids: whether the type of the messages has ids.
        kept_s: a name that is not used for so long loses its number; None: never, s.
        recording: the ids in all messages, which then decide; None: the last messages of a live stream do.

    Attributes:
        unnamed: number of detections without an id, among those that are identified by ids.
        names: number -> name of people whose name is not their number.

    Raises:
        ValueRuleError: there is no such mode.
    """

    def __init__(
        self,
        mode: str = "auto",
        has_ids: bool = True,
        kept_s: float | None = None,
        recording: Sequence[Sequence[str]] | None = None,
    ):
        check_choice("identities", mode, MODES)
        self._mode = mode if has_ids or mode == "given" else "assigned"
        self._kept_s, self._is_live, self.unnamed = kept_s, recording is None, 0
        self._nearest, self._numbers = NearestTracks(), TrackNumbers()
        self._used_s: dict[str, float] = {}
        self.names: dict[int, str] = {}
        self._recent: deque[Sequence[str]] = deque(maxlen=_MESSAGES)
        self._ignores_ids = False
        if self._mode == "auto" and not are_identities([_known(ids) for ids in recording or ()]):
            _log.warning(_ASSIGNED)
            self._mode = "assigned"

    def name(self, number: int) -> str:
        """The name of a person."""
        return self.names.get(number, str(number))

    def number(self, time_s: float, ids: Sequence[str], position: np.ndarray) -> np.ndarray:
        """Number the people of a message.

        Args:
            time_s: of the message, s.
            ids: of the people; -1, NaN and empty ones are none. [D]
            position: in a frame that does not move, m; NaN where unknown. [D, 2]

        Returns:
            [D] int64

        Raises:
            ValueRuleError: ids must be given, and one is missing or given to several people.
        """
        if self._mode == "assigned":
            return self._nearest.assign(time_s, position)
        names = _known(ids)
        if self._mode == "given" and ("" in names or len(set(names)) < len(names)):
            raise ValueRuleError("id", names, f"each person needs an own id: {_REMEDY}")
        if self._mode == "auto" and self._is_live and names:
            self._decide(names)
        if self._ignores_ids:
            names = [""] * len(names)
        unnamed = np.array([not name for name in names], bool)
        if unnamed.any():
            self.unnamed += 0 if self._ignores_ids else int(unnamed.sum())
            assigned = iter(self._nearest.assign(time_s, position[unnamed]).tolist())
            names = [name or f"#{next(assigned)}" for name in names]
        return self._numbered(time_s, names)

    def correct(self, turn_rad: float, shift: np.ndarray) -> None:
        """See `NearestTracks.correct`."""
        self._nearest.correct(turn_rad, shift)

    def _decide(self, names: Sequence[str]) -> None:
        """Decide whether ids count from this message on, and log a change."""
        self._recent.append(names)
        before, self._ignores_ids = self._ignores_ids, not are_identities(self._recent)
        if self._ignores_ids and not before:
            _log.warning(_ASSIGNED)
        elif before and not self._ignores_ids:
            _log.info("people have ids from here on")

    def _numbered(self, time_s: float, names: Sequence[str]) -> np.ndarray:
        """Numbers of names; names that have not been used for `kept_s` are dropped."""
        self._used_s |= dict.fromkeys(names, time_s)
        if self._kept_s is not None:
            for name in [n for n, used_s in self._used_s.items() if abs(time_s - used_s) > self._kept_s]:
                self.names.pop(self._numbers.number(name), None)
                self._numbers.forget(name)
                del self._used_s[name]
        numbers = [self._numbers.number(name) for name in names]
        self.names |= {number: name for number, name in zip(numbers, names, strict=True) if number < 0}
        return np.array(numbers, np.int64)


def _known(ids: Sequence[str]) -> list[str]:
    """The ids, empty where they are none."""
    return ["" if each.lower() in _NO_IDS else each for each in ids]
