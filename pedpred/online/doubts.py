"""Doubts about a stream: what detections cannot be, although their forecasts look sound.

A tracker that deals out ids anew, lengths in another unit, positions that are repeated, or a map in another
frame spoil forecasts, and no single frame tells. So detections are counted, and a warning says what is wrong
with many of them. Forecasts do not depend on it.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pedpred.online.frame import Frame
from pedpred.online.people import People
from pedpred.scenes import OccupancyMap
from pedpred.tracking.steps import are_too_long, catch_up
from pedpred.tracking.tracks import FASTEST_MPS

_log = logging.getLogger(__name__)
_FRAMES, _JUDGED = 10, 30
"""So many frames, and so many detections in them, are judged together."""
_WALKING_MPS = 0.5
"""People who are slower may lean on a wall, sit on a bench, or be furniture."""
_TOGETHER, _JUMP_M, _JUMP_MPS, _ALIKE = 3, 0.3, 2.0, 0.25
"""So many people, or more, jump together if all are elsewhere than expected by the same way, which is longer
than these, m and m/s, and differs by no more than this share of its length."""


class Kind(NamedTuple):
    """What can be odd.

    Attributes:
        most: share of the judged ones that may be.
        wrong: what is wrong if more are, in words.
    """

    most: float
    wrong: str


_KINDS = {
    "new": Kind(
        0.5,
        "detections have ids that are new: do ids stay with people? Who is new is forecast to stand",
    ),
    "steps": Kind(
        0.2,
        "steps of people are longer than anybody moves: do ids change hands or belong to two trackers, are "
        "positions not in metres or times not in seconds, or does the frame of the positions jump?",
    ),
    "together": Kind(
        0.05,
        "frames have everybody jump by the same way: does the localisation jump? Publish people in the frame "
        "of the odometry, or call `correct`",
    ),
    "repeats": Kind(
        0.5,
        "times when people move on after standing still, they catch up in one step: does the tracker repeat "
        "old positions under new stamps? Pass each position once, with its time",
    ),
    "blocked": Kind(
        0.1,
        "detections of people who walk are in obstacles of the map: is it mirrored, shifted, in another "
        "frame, out of date or a costmap?",
    ),
    "outside": Kind(
        0.5,
        "detections of people who walk are outside the map: is it in another frame? The ground there is free",
    ),
}


class Count(NamedTuple):
    """What is known of one kind: odd ones of those judged, in some frames; whether there are too many.

    Attributes:
        odd: in the present block.
        judged: in the present block.
        frames: with any of them.
        text: what was wrong with the last block; empty if nothing.
    """

    odd: int = 0
    judged: int = 0
    frames: int = 0
    text: str = ""

    def after(self, odd: np.ndarray, kind: Kind) -> Count:
        """The count after a frame: `odd` for each of those who are judged. [N] bool."""
        if not len(odd):
            return self
        found, judged, frames = self.odd + np.count_nonzero(odd), self.judged + len(odd), self.frames + 1
        if frames < _FRAMES or judged < _JUDGED:
            return Count(found, judged, frames, self.text)
        most = kind.most * (0.5 if self.text else 1.0)  # what comes and goes is told once
        return Count(text=f"{found} of the last {judged} {kind.wrong}" if found > most * judged else "")


@dataclass(frozen=True)
class Doubts:
    """The counts of all kinds, as a value.

    Attributes:
        counts: kind -> count.
    """

    counts: Mapping[str, Count]

    @classmethod
    def none(cls) -> Doubts:
        """At the beginning of a stream."""
        return cls({kind: Count() for kind in _KINDS})

    @property
    def texts(self) -> tuple[str, ...]:
        """What is wrong at present, in words."""
        return tuple(count.text for count in self.counts.values() if count.text)

    def after(self, people: People, frame: Frame, occupancy: OccupancyMap | None) -> Doubts:
        """The doubts after a frame.

        Args:
            people: before it.
            frame: later than they were seen.
            occupancy: the map; None without one.
        """
        row, known = people.rows_of(frame.track_id)
        rows = row[known]
        place, gap_s = frame.position[known], frame.time_s - people.seen_s[rows]
        way_m = np.hypot(*(place - people.detection[rows]).T)
        ahead = place - people.detection[rows] - gap_s[:, None] * people.velocity[rows]
        speed_mps = np.hypot(*people.velocity[rows].T)
        stood = ~people.past["last_velocity"][rows].any(axis=1) & (people.seen_s > people.born_s)[rows]
        walks = speed_mps >= _WALKING_MPS
        odd = {
            "new": ~known if len(people) else known[:0],
            "steps": are_too_long(way_m, gap_s) | (speed_mps > FASTEST_MPS),
            "together": np.array([_jump_together(ahead, gap_s)] if len(rows) >= _TOGETHER else [], bool),
            "repeats": catch_up(stood, way_m, gap_s)[stood & (way_m > 0.0)],
        }
        if occupancy is not None:
            cells = occupancy.cell_of(place[walks])
            odd["blocked"] = occupancy.is_occupied(place[walks])
            odd["outside"] = ((cells < 0) | (cells >= occupancy.occupied.shape)).any(axis=-1)
        judged = {kind: self.counts[kind].after(values, _KINDS[kind]) for kind, values in odd.items()}
        return Doubts({**self.counts, **judged})

    def tell(self, before: Doubts, time_s: float) -> None:
        """Warn about what is wrong now, and was not before."""
        for kind, count in self.counts.items():
            if count.text and not before.counts[kind].text:
                _log.warning("at %.10g s: %s", time_s, count.text)


def _jump_together(ahead: np.ndarray, gap_s: np.ndarray) -> bool:
    """Whether people are elsewhere than expected by the same way.

    Args:
        ahead: from where each is expected to where he or she is, m. [N, 2]
        gap_s: time since each was seen, s. [N]
    """
    mean = ahead.mean(axis=0)
    length_m = float(np.hypot(*mean))
    apart_m = float(np.hypot(*(ahead - mean).T).max())
    return length_m > _JUMP_M + _JUMP_MPS * float(gap_s.max()) and apart_m < _ALIKE * length_m
