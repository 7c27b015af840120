"""The branches that `tools.branches` rebuilds side by side need nothing of each other."""

import subprocess
from itertools import combinations

import networkx as nx
import pytest

from pedpred.config import read_params
from tests.conftest import ROOT
from tools.branches import LSTMS, SHARED, follow, memoryless, needed, pipeline

TRAININGS = ("pretrain", "distil", "train", "finetune")
pytestmark = pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")  # of DVC


@pytest.fixture(scope="module")
def graph():
    return pipeline(ROOT)


@pytest.fixture(scope="module")
def branches(graph):
    """Names of the stages of each branch."""
    return [set(needed(graph, targets)) for targets in (LSTMS, *memoryless(read_params(ROOT)).values())]


def test_stages_come_after_those_that_they_need(graph):
    order = needed(graph, LSTMS)
    assert {"ingest@eth", "train_main@lstm", "validate_simulation"} < set(order)
    assert "train_situations@mixture" not in order
    for name in order:
        assert nx.descendants(graph, name) <= set(order[: order.index(name)])


def test_branches_need_in_common_only_what_ran_before(graph, branches):
    for one, other in combinations(branches, 2):
        assert one & other <= set(needed(graph, SHARED))


def test_every_training_is_in_one_of_them(graph, branches):
    assert {name for name in graph if name.startswith(TRAININGS)} <= set().union(*branches)


def test_a_log_is_shown_from_now_on_to_its_end(tmp_path, capsys):
    log = tmp_path / "log"
    log.write_text("before\n")
    with (
        log.open("a") as output,
        subprocess.Popen(["sh", "-c", "echo first; sleep 0.1; echo last"], stdout=output) as process,
    ):
        follow(process, log)
    assert capsys.readouterr().out.endswith("last\n")
    follow(process, log)
    assert capsys.readouterr().out == ""
