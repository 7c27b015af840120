"""Log records of the library as those of a ROS node, each kind at most once in some seconds."""

from __future__ import annotations

import logging
import time
from typing import Any

EVERY_S = 5.0


class RosHandler(logging.Handler):
    """Hands records to a ROS logger; of records with the same wording only the first one in `EVERY_S`.

    Args:
        logger: of the node.
    """

    def __init__(self, logger: Any):
        super().__init__()
        self._logger = logger
        self._said: dict[str, tuple[float, int]] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Say a record, with the number of those like it that were not said."""
        now_s = time.monotonic()
        said_s, count = self._said.get(str(record.msg), (-EVERY_S, 0))
        if now_s - said_s < EVERY_S:
            self._said[str(record.msg)] = said_s, count + 1
            return
        self._said[str(record.msg)] = now_s, 0
        text = self.format(record) + (f" ({count} more like this)" if count else "")
        if record.levelno >= logging.ERROR:
            self._logger.error(text)
        elif record.levelno >= logging.WARNING:
            self._logger.warning(text)
        else:
            self._logger.info(text)
