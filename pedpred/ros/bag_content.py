"""What is read from the messages of a bag while some are wrong: these are left out, and counted."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from pedpred.errors import PedpredError, brief
from pedpred.ros.bag_reader import BagReader
from pedpred.ros.decoding import Connection
from pedpred.ros.scene_messages import check_grid, updated_grid

_log = logging.getLogger(__name__)


class Messages:
    """Decodes messages.

    Attributes:
        first: why the first damaged one could not be decoded; None where there is none.
    """

    def __init__(self, path: Path, bag: BagReader):
        self._path, self._bag = path, bag
        self._count, self._damaged, self._topic = 0, 0, ""
        self.first: Exception | None = None

    def decoded(self, raw: bytes, connection: Connection) -> Any | None:
        """The message; None if it is damaged.

        Raises:
            PedpredError: it would unpack to too much.
        """
        self._count += 1
        try:
            if not raw.strip(b"\0"):
                raise ValueError("nothing but zeros")
            return self._bag.decode(raw, connection)
        except PedpredError:
            raise
        except Exception as cause:  # whatever rosbags raises on damaged bytes
            self._damaged += 1
            if self.first is None:
                self.first, self._topic = cause, connection.topic
            return None

    def tell(self) -> None:
        """Warn of those that were damaged."""
        if self.first is not None:
            text = "%s: left out: %d of %d messages, which are damaged (%s: %s)"
            _log.warning(text, self._path, self._damaged, self._count, self._topic, brief(str(self.first)))


class Ground:
    """The map of a bag: the last message that is a map, with the updates after it that fit it.

    Attributes:
        grid: the map as a nav_msgs/OccupancyGrid; None before the first.
    """

    def __init__(self, path: Path):
        self._path = path
        self.grid: Any = None
        self._wrong, self._topic = 0, ""  # since the last whole map
        self._first: PedpredError | None = None

    def take(self, topic: str, message: Any, is_update: bool) -> None:
        """Take a map, or an update, which counts for nothing without a map before."""
        try:
            if not is_update:
                check_grid(message)
                self.grid, self._wrong = message, 0
            elif self.grid is not None:
                self.grid = updated_grid(self.grid, message)
        except PedpredError as problem:
            self._wrong += 1
            if self._wrong == 1:
                self._first, self._topic = problem, topic

    def tell(self) -> None:
        """Warn of what would have changed the map.

        Raises:
            PedpredError: no message is a map.
        """
        if self._wrong and self._first is not None:
            if self.grid is None:
                raise self._first
            text = "%s: left out: %d messages that change the map, the first on %s (%s); the map before stays"
            _log.warning(text, self._path, self._wrong, self._topic, self._first)
