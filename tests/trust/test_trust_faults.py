"""What ends a stage in the middle is said in words, and the next run starts from whole files."""

import errno
import os
import signal

import pytest

from pedpred import config
from pedpred.errors import WorkerError
from pedpred.workers import in_parallel
from tests.trust.faults import STAGES, killed, plan


def killed_by_the_system():
    """A job that ends as one does that takes too much memory."""
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_killed_worker_is_said_in_words(monkeypatch):
    monkeypatch.setenv("PEDPRED_JOBS", "2")
    with pytest.raises(WorkerError, match=r"simulate main: a worker process was killed.*PEDPRED_JOBS=1"):
        in_parallel(killed_by_the_system, [()], "simulate main", "room")


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EACCES])
def test_a_full_or_locked_disk_is_said_in_words(number):
    def write():
        with config._explained(None):
            raise OSError(number, os.strerror(number), "data/scenes/main")

    with pytest.raises(SystemExit, match=r"data/scenes/main.*run dvc repro again"):
        write()


def test_another_fault_of_the_system_keeps_its_traceback():
    def read():
        with config._explained(None):
            raise OSError(errno.EIO, "broken")

    with pytest.raises(OSError, match="broken"):
        read()


def test_the_campaign_kills_every_kind_of_stage():
    faults = plan(list(STAGES), kills=2, mounts=True)
    assert sum(fault is killed for fault, _ in faults) == 2 * len(STAGES)
    assert {stage for _, stage in faults} == set(STAGES)
