"""Is the robot among its people? Another camera may take it for one, and costmaps then block it."""

from __future__ import annotations

import logging

import numpy as np

from pedpred.online.doubts import Count, Kind

_log = logging.getLogger(__name__)
_NEAR_M = 0.2
"""Nobody is so near the middle of a robot for long."""
_KIND = Kind(
    0.5,
    f"messages have somebody within {_NEAR_M:g} m of the robot's base: is the robot taken for a person? "
    "Leave it out in the detector, or its own costmaps may block it",
)


class RobotSeen:
    """Counts messages in which somebody is where the robot is.

    Attributes:
        text: what is wrong at present, in words; empty if nothing.
    """

    def __init__(self) -> None:
        self._count, self.text = Count(), ""

    def note(self, base: np.ndarray, place: np.ndarray) -> None:
        """Count a message of people.

        Args:
            base: where the robot is, m; NaN if nobody knows. [2]
            place: where people are, m. [N, 2]
        """
        if not len(place) or not np.isfinite(base).all():
            return
        near = np.hypot(*(place - base).T) < _NEAR_M
        self._count = self._count.after(near.any(keepdims=True), _KIND)
        if self._count.text and not self.text:
            _log.warning("%s", self._count.text)
        self.text = self._count.text
