"""At most so many people are followed, so that an update takes a bounded time and memory, whoever sends."""

from __future__ import annotations

import numpy as np

from pedpred.online.frame import Frame
from pedpred.online.people import People


def keep_to_limit(people: People, frame: Frame, most: int) -> tuple[People, Frame]:
    """Leave people out, so that at most `most` are followed after a frame.

    People who are followed and detected stay. New ones take the room that is left, the lowest ids first, then
    those who are not detected now, the last seen first. Up to the limit, nobody is left out.

    Args:
        people: before the frame, at most `most`.
        frame: of any number of people.
        most: at least 1.
    """
    if len(people) + len(frame) <= most:
        return people, frame
    known = np.isin(frame.track_id, people.track_id, assume_unique=True)
    frame = frame.select(known | (np.cumsum(~known) <= most - known.sum()))
    seen = np.isin(people.track_id, frame.track_id, assume_unique=True)
    latest = np.lexsort((people.life, -people.seen_s, ~seen))
    return people.select(np.sort(latest[: known.sum() + most - len(frame)])), frame
