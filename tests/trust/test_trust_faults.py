"""A stage that ends in the middle gives the cause, and the next run starts from whole files."""

import errno
import os
import signal

import pytest

from pedpred.errors import PedpredError, user_errors
from pedpred.workers import in_parallel
from tests.configuration import read
from tests.trust.faults import killed, killed_half_trained, plan
from tests.trust.project import ROOT, kinds, pipeline


def test_a_killed_worker_is_an_error_with_a_remedy(monkeypatch):
    """As one is that takes too much memory; its job is none of this module, whose imports take seconds."""
    monkeypatch.setenv("PEDPRED_JOBS", "2")
    with pytest.raises(PedpredError, match="PEDPRED_JOBS=1"):
        in_parallel(signal.raise_signal, [(signal.SIGKILL,)] * 2, "simulate main", "room")


@pytest.mark.parametrize("number", [errno.EROFS, errno.EACCES, errno.ENOSPC])
def test_a_full_or_locked_disk_ends_with_a_remedy(number):
    with pytest.raises(SystemExit) as ended, user_errors():
        raise OSError(number, "it is locked", "data/scenes/main")
    assert "make room on the disk" in str(ended.value)


def test_other_errors_of_the_system_ask_for_no_room():
    with pytest.raises(SystemExit) as ended, user_errors():
        raise OSError(errno.ENOENT, os.strerror(errno.ENOENT), "dvc")
    assert "make room" not in str(ended.value)
    with pytest.raises(OSError, match="broken"), user_errors():
        raise OSError(errno.EIO, "broken")


@pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")  # of DVC
def test_the_campaign_disturbs_every_kind_of_stage():
    found = pipeline(ROOT)
    order = list(found)
    chain = ["fetch@ewap", "rows@lstm-real", "train@lstm_folds", "evaluate_folds@lstm", "report"]
    assert sorted(chain, key=order.index) == chain
    stages = kinds(found)
    assert sorted(name.split("@")[0] for name in stages) == sorted(read("dvc.yaml")["stages"])
    faults = plan(stages, kills=2, mounts=True)
    assert sorted(stage for fault, stage in faults if fault is killed) == sorted(2 * [*stages])
    assert {stage.split("@")[0] for fault, stage in faults if fault is killed_half_trained} == {"train"}
