"""Messages that were sent and never read: a queue that is full drops the oldest ones, and says nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_MOST_PUBLISHERS = 100


class Arrivals:
    """Finds gaps in the numbers that a middleware gives to the messages of each publisher."""

    def __init__(self) -> None:
        self._latest: dict[str, int] = {}

    def missed(self, about: Mapping[str, Any]) -> int:
        """How many messages of the same publisher are missing between the last one and this one.

        Args:
            about: what rclpy knows of a message; 0 where it names no publisher or no number, as in Humble.
        """
        publisher, number = about.get("publisher_gid"), about.get("publication_sequence_number")
        if publisher is None or number is None:
            return 0
        before = self._latest.pop(str(publisher), number - 1)
        self._latest[str(publisher)] = max(number, before)
        while len(self._latest) > _MOST_PUBLISHERS:
            del self._latest[next(iter(self._latest))]  # the one that was heard the longest ago
        return max(number - before - 1, 0)
