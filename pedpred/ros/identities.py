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
    """Track numbers for names: 7 keeps its value; other names, also 007, get -1, -2, ... in order.

    Args:
        kept_s: a name that is not used for so long is dropped, and its number is not used again; None:
            never, s.

    Attributes:
        names: number -> name, where the name is not the number.
    """

    def __init__(self, kept_s: float | None = None) -> None:
        self._kept_s, self._next = kept_s, -1
        self.names: dict[int, str] = {}
        self._numbers: dict[str, int] = {}
        self._used_s: dict[int, float] = {}

    def numbers(self, time_s: float, names: Sequence[str]) -> np.ndarray:
        """Numbers of names at a time, s; different names have different ones, of 64 bits. [D] int64."""
        numbers = [self._number(name) for name in names]
        self._used_s |= {number: time_s for number in numbers if number < 0}
        if self._kept_s is not None:
            for number in [n for n, used_s in self._used_s.items() if abs(time_s - used_s) > self._kept_s]:
                del self._used_s[number], self._numbers[self.names.pop(number)]
        return np.array(numbers, np.int64)

    def _number(self, name: str) -> int:
        is_short = name.isascii() and name.isdecimal() and len(name) <= len(str(_LARGEST))
        if is_short and name == str(int(name)) and int(name) <= _LARGEST:
            return int(name)
        if name not in self._numbers:
            self._numbers[name], self.names[self._next] = self._next, name
            self._next -= 1
        return self._numbers[name]


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
        self._is_live, self.unnamed = recording is None, 0
        self._nearest, self._tracks = NearestTracks(), TrackNumbers(kept_s)
        self._recent: deque[Sequence[str]] = deque(maxlen=_MESSAGES)
        self._ignores_ids = False
        if self._mode == "auto" and not are_identities([_known(ids) for ids in recording or ()]):
            _log.warning(_ASSIGNED)
            self._mode = "assigned"

    @property
    def names(self) -> dict[int, str]:
        """Number -> name of people whose name is not their number."""
        return self._tracks.names

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
        return self._tracks.numbers(time_s, names)

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


def _known(ids: Sequence[str]) -> list[str]:
    """The ids, empty where they are none."""
    return ["" if each.lower() in _NO_IDS else each for each in ids]
