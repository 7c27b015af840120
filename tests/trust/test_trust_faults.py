"""A stage that ends in the middle says why, and the next run starts from whole files."""

import errno
import os
import signal
import subprocess
import sys

import pytest

from pedpred.errors import PedpredError, user_errors
from pedpred.workers import in_parallel
from tests.configuration import read
from tests.trust.faults import CLOCK, killed, killed_half_trained, plan, under_a_jumping_clock
from tests.trust.project import ROOT, kinds, pipeline


def test_a_killed_worker_is_an_error_with_a_remedy(monkeypatch):
    """As one is that takes too much memory; its job is none of this module, whose imports take seconds."""
    monkeypatch.setenv("PEDPRED_JOBS", "2")
    with pytest.raises(PedpredError, match="PEDPRED_JOBS=1"):
        in_parallel(signal.raise_signal, [(signal.SIGKILL,)] * 2, "simulate main", "room")


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EACCES])
def test_a_full_or_locked_disk_ends_with_a_remedy(number):
    said = r"data/scenes/main.*make room on the disk or the folder writable"
    with pytest.raises(SystemExit, match=said), user_errors():
        raise OSError(number, os.strerror(number), "data/scenes/main")


def test_another_fault_of_the_system_keeps_its_traceback():
    with pytest.raises(OSError, match="broken"), user_errors():
        raise OSError(errno.EIO, "broken")


of_dvc = pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")


@pytest.fixture(scope="module")
def order():
    """The stages of the project in the order in which they run."""
    return pipeline(ROOT)


@of_dvc
def test_the_campaign_disturbs_every_kind_of_stage(order):
    stages = kinds(order)
    declared = read("dvc.yaml")["stages"]
    assert sorted(name.split("@")[0] for name in stages) == sorted(declared)
    faults = plan(stages, kills=2, mounts=True)
    for fault, times in ((killed, 2), (under_a_jumping_clock, 1)):
        assert sorted(stage for kind, stage in faults if kind is fault) == sorted([*stages] * times)
    half_trained = {stage.split("@")[0] for fault, stage in faults if fault is killed_half_trained}
    assert half_trained == {"train"}


@of_dvc
def test_the_campaign_knows_the_order_of_the_stages(order):
    order = list(order)
    chain = [
        order.index(stage)
        for stage in ("fetch@ewap", "rows@lstm-real", "train@lstm_folds", "evaluate_folds@lstm", "report")
    ]
    assert chain == sorted(chain)


def test_the_clock_of_the_campaign_jumps():
    look = "import time; print(*(round(time.time()) for _ in range(9)))"
    command = [sys.executable, "-c", look]
    said = subprocess.run(command, env=os.environ | CLOCK, capture_output=True, check=True)
    seen = [int(word) for word in said.stdout.split()]
    assert seen != sorted(seen)
