"""Log records of the library as those of a ROS node, each kind at most once in some seconds."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

from pedpred.errors import PedpredError

EVERY_S = 5.0
_log = logging.getLogger(__name__)


def guarded(lost: str, callback: Callable[..., None]) -> Callable[..., None]:
    """A callback that logs every error and goes on: a bad message must not end the node.

    Args:
        lost: what is missing after an error, such as "message of 'map' left out".
        callback: it may be called again after an error.
    """

    def called(*arguments: Any) -> None:
        try:
            callback(*arguments)
        except Exception as problem:  # the next message may be sound
            name, field = type(problem).__name__, str(getattr(problem, "field", "")).partition("[")[0]
            text = "%s: " + ("" if isinstance(problem, PedpredError) else f"{name}: ")
            _log.error(text + "%s", lost, problem, extra={"kind": (lost, name, field)})

    return called


class RosHandler(logging.Handler):
    """Hands records to a ROS logger; of records with the same wording only the first one in `EVERY_S`.

    Args:
        logger: of the node.
    """

    def __init__(self, logger: Any):
        super().__init__()
        self._logger = logger
        self._latest: dict[str, tuple[float, int]] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Log a record, with the number of similar ones that were left out.

        Similar are those with the same wording, or with the same `kind` where they have one (`extra`).
        """
        now_s, kind = time.monotonic(), str(getattr(record, "kind", record.msg))
        logged_s, count = self._latest.get(kind, (-EVERY_S, 0))
        if now_s - logged_s < EVERY_S:
            self._latest[kind] = logged_s, count + 1
            return
        self._latest[kind] = now_s, 0
        text = self.format(record) + (f" ({count} more like this)" if count else "")
        if record.levelno >= logging.ERROR:  # rclpy wants a line of code for each severity
            self._logger.error(text)
        elif record.levelno >= logging.WARNING:
            self._logger.warning(text)
        else:
            self._logger.info(text)
