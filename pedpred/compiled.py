"""Loops that are compiled for the processor.

They run in the calling thread, without the interpreter's lock: worker processes share the cores, and threads
that wait for work would take them from a robot's other processes. Forked processes and several threads may
call them. The compiled code is kept beside the source, or in `$NUMBA_CACHE_DIR`; compiling is announced.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core.event import Event, Listener, register

_LOG = logging.getLogger(__name__)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function at its first call; a division by zero gives inf or nan, as in numpy."""
    loop: Callable[..., Any] = njit(cache=True, nogil=True, error_model="numpy")(function)
    return loop


class _Announcement(Listener):
    """Log once in a process that compiling takes a while."""

    given = False

    def on_start(self, event: Event) -> None:
        """Look whose function it is."""
        if not self.given and event.data["dispatcher"].py_func.__module__.startswith("pedpred."):
            self.given = True
            _LOG.warning("compiling loops for this processor: takes some seconds, once per installation")

    def on_end(self, event: Event) -> None:
        """Nothing to say."""


register("numba:compile", _Announcement())
