"""Counters of a node, for diagnostics."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass
class Counts:
    """Counters since the start.

    Attributes:
        messages: of people.
        forecasts: published.
        people: in the last forecast.
        lost: messages left out for want of a transform.
        late: messages left out since they are older than the last forecast.
        slow: messages left out since forecasts take too long.
        refused: messages left out for an error.
        jumps: of time, at which all people were forgotten.
        without_forecast: people left out.
        detections: of people.
        others: detections of other classes.
        near_robot: detections left out as those of the robot.
    """

    messages: int = 0
    forecasts: int = 0
    people: int = 0
    lost: int = 0
    late: int = 0
    slow: int = 0
    refused: int = 0
    jumps: int = 0
    without_forecast: int = 0
    detections: int = 0
    others: int = 0
    near_robot: int = 0

    @property
    def left_out(self) -> int:
        """Messages without a forecast."""
        return self.lost + self.late + self.slow + self.refused

    @contextmanager
    def count_errors(self) -> Iterator[None]:
        """Count the message that an error is raised for."""
        try:
            yield
        except Exception:
            self.refused += 1
            raise
