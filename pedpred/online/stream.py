"""The clock of a stream of frames: which go on, come late, or begin anew after a jump of time."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from enum import Enum, auto

import numpy as np

from pedpred.tracking.tracks import TIME_TOLERANCE_S

_LOG = logging.getLogger(__name__)
_WHY_JUMPS = "A clock was set, a stamp is false, or a recording or simulation began again"
_SET_BACK_S, _CALM_S = 0.3, 5.0
"""Frames that are earlier than the last one for so long, while none is later, are of a clock that was set
back, or that one false stamp had been ahead of. Each time, it must be for twice as long, until none was
earlier for some time: a fast sensor that lags behind a slow one must not make everybody new for ever."""


class Arrival(Enum):
    """What a frame is to the stream."""

    NEXT = auto()
    """It is later than the last one."""
    LATE = auto()
    """It is as late as the last one, or somewhat earlier."""
    SET_BACK = auto()
    """The clock was set back to it: all people are forgotten."""
    JUMP = auto()
    """Time jumped by more than `StreamClock.longest_s`: all people are forgotten."""


@dataclass(frozen=True)
class StreamClock:
    """The time of a stream, as a value.

    Attributes:
        longest_s: a longer gap, forward or backward, is a jump, s.
        now_s: time of the last frame that was taken, s.
        jumps: how often people were forgotten.
        dropped_s: the first and the last frame dropped since the last one that was taken, s; inf: none.
        set_back_s: for how long frames must be earlier, s.
        latest_drop_s: `now_s` when a frame was last dropped, s.
    """

    longest_s: float
    now_s: float = -np.inf
    jumps: int = 0
    dropped_s: tuple[float, float] = (np.inf, np.inf)
    set_back_s: float = _SET_BACK_S
    latest_drop_s: float = -np.inf

    def arrival(self, time_s: float) -> Arrival:
        """What a frame at a time would be."""
        if abs(time_s - self.now_s) > self.longest_s:
            return Arrival.JUMP
        if time_s > self.now_s + TIME_TOLERANCE_S:
            return Arrival.NEXT
        first_s, last_s = self.dropped_s
        rises = time_s > last_s and time_s - first_s > self.set_back_s - TIME_TOLERANCE_S
        return Arrival.SET_BACK if rises else Arrival.LATE

    def accept(self, time_s: float, people: int) -> tuple[StreamClock, Arrival]:
        """The clock after a frame, and what the frame is; of a late one, the clock stays.

        Warns where people are forgotten; of long gaps that follow each other, the first one.

        Args:
            time_s: of the frame, s.
            people: how many are known.
        """
        arrival = self.arrival(time_s)
        if arrival is Arrival.LATE:
            return self, arrival
        clock = replace(self.completed(), now_s=time_s)
        if arrival is Arrival.SET_BACK:
            clock = replace(clock, set_back_s=2 * self.set_back_s)
        elif time_s - self.latest_drop_s > _CALM_S:
            clock = replace(clock, set_back_s=_SET_BACK_S)
        if arrival is not Arrival.NEXT and people:
            if time_s < self.now_s or not self.jumps:
                text = "time jumps from %s s to %s s (seconds?): all are forgotten. %s"
                _LOG.warning(text, self.now_s, time_s, _WHY_JUMPS)
            clock = replace(clock, jumps=self.jumps + 1)
        return clock, arrival

    def completed(self) -> StreamClock:
        """The clock after a late frame that tells of people who were not in the last one."""
        return replace(self, dropped_s=(np.inf, np.inf))

    def dropped(self, time_s: float) -> StreamClock:
        """The clock after a late frame that is dropped; warns of the first of several."""
        first_s, last_s = self.dropped_s
        if time_s <= last_s:
            first_s = time_s
            text = "frame at %s s dropped: the last one was at %s s. %s"
            _LOG.warning(text, time_s, self.now_s, "Do two sources send the same people, or late?")
        return replace(self, dropped_s=(first_s, time_s), latest_drop_s=self.now_s)
