"""Run functions in forked processes, with limits of time and memory."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_MEMORY_BYTES = 16 * 2**30
_STRETCH = 20
"""Seconds by the clock for each second of the processor: other processes need it, too."""


@dataclass(frozen=True)
class Job:
    """A function and its limit.

    Attributes:
        run: returns a status, 0 to 99, and a text. Its output is discarded; `TMPDIR` is a folder of its own.
        seconds: of the processor that it may need.
        about: what is given back with the result.
    """

    run: Callable[[], tuple[int, str]]
    seconds: float
    about: Any


def run_forked(jobs: Sequence[Job], most: int, folder: Path) -> Iterator[tuple[Any, int, str]]:
    """Run jobs, `most` at once; yields `about`, status and text of each one that has ended.

    The status of a job that needs more time or memory, or crashes, is negative or above 99.
    """
    queue = list(reversed(jobs))
    running: dict[int, tuple[Any, float, Path]] = {}
    try:
        while queue or running:
            while queue and len(running) < most:
                job, own = queue.pop(), folder.absolute() / f"{os.getpid()}-{len(queue)}"
                if not (pid := os.fork()):
                    _child(job, own)
                running[pid] = job.about, time.monotonic() + _STRETCH * job.seconds, own
            for pid, (about, deadline, own) in list(running.items()):
                late = time.monotonic() > deadline
                if late:
                    os.kill(pid, signal.SIGKILL)
                ended, status = os.waitpid(pid, 0 if late else os.WNOHANG)
                if ended:
                    del running[pid]
                    _kill_group(pid)
                    result = own / "result"
                    text = result.read_text() if result.exists() else ""
                    shutil.rmtree(own, ignore_errors=True)
                    yield about, os.waitstatus_to_exitcode(status), text
            time.sleep(0.003)
    finally:
        for pid in running:
            _kill_group(pid)


def _kill_group(pid: int) -> None:
    """End what a child has started, too."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


def _child(job: Job, folder: Path) -> None:
    """Run a job in this forked process, and end it."""
    status = 100
    try:
        os.setpgid(0, 0)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        folder.mkdir(parents=True, exist_ok=True)
        silent = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silent, 1)
        os.dup2(silent, 2)
        os.environ["TMPDIR"] = str(folder)
        resource.setrlimit(resource.RLIMIT_CPU, (int(job.seconds) + 1,) * 2)
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES,) * 2)
        status, text = job.run()
        (folder / "result").write_text(text)
    finally:
        os._exit(status)
