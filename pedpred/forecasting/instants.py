"""Learning along a stream, instant by instant: what trust and regions share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import Protocol, TypeVar

import numpy as np

from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S

EVERY_S = 0.3
"""Least time between instants whose forecasts are kept, s."""
KNOWN, LATELY_S = 4, 4.0
"""Forecasts are kept of people who were detected so often, as in the evaluation, in so many seconds."""

Instants = tuple[Predictions, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Predictions, world frame, and person, time_s, detection and seen of `Regions.after`, at whole instants."""


Self = TypeVar("Self", bound="Learned")


class Learned(Protocol):
    """What was learned at a place, and what is needed to learn more."""

    def without_people(self: Self) -> Self:
        """What was learned, with nobody to learn from."""

    def after(
        self: Self,
        time_s: float,
        person: np.ndarray,
        detection: np.ndarray,
        seen: np.ndarray,
        forecasts: Predictions,
    ) -> tuple[Self, Predictions]:
        """Take the detections of an instant and the forecasts from it."""


def learn_along(
    unlearned: Callable[[int], Self], parts: Iterable[Instants], lost_after_s: float
) -> Iterator[Instants]:
    """Yield the same instants with forecasts that learn, each from earlier instants only.

    Args:
        unlearned: what is known before the first instant, for so many steps of the horizon.
        parts: instants that never fall, with no more than one part in memory.
        lost_after_s: after a longer time without an instant, all people are new, as on a robot, s.
    """
    learned: Self | None = None
    before_s = np.inf
    for predictions, person, time_s, detection, seen in parts:
        learned = learned or unlearned(predictions.steps)
        afterwards = [predictions.select(np.zeros(0, np.int64))]
        later = np.flatnonzero(np.diff(time_s) > TIME_TOLERANCE_S) + 1
        for begin, end in pairwise([0, *later.tolist(), len(predictions)]):
            now = np.arange(begin, end)
            current, now_s = predictions.select(now), float(time_s[begin])
            if now_s - before_s > lost_after_s + TIME_TOLERANCE_S:
                learned = learned.without_people()
            learned, changed = learned.after(now_s, person[now], detection[now], seen[now], current)
            afterwards.append(changed)
            before_s = time_s[end - 1]
        yield Predictions.join(afterwards), person, time_s, detection, seen
