"""The branches that `tools.branches` rebuilds side by side need nothing of each other."""

import subprocess
from itertools import combinations

import networkx as nx
import pytest
from dvc.repo import Repo

from pedpred.config import read_params
from tests.conftest import ROOT
from tools.branches import LSTMS, SHARED, follow, memoryless

TRAININGS = ("pretrain", "distil", "train", "finetune")
pytestmark = pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")  # of DVC


@pytest.fixture(scope="module")
def graph():
    found = Repo(str(ROOT)).index.graph
    return nx.relabel_nodes(found, {stage: stage.name for stage in found})


@pytest.fixture(scope="module")
def branches(graph):
    """Names of the stages of each branch."""
    return [reached(graph, targets) for targets in (LSTMS, *memoryless(read_params(ROOT)).values())]


def reached(graph, targets):
    """Names of the stages that some targets need, and of those."""
    stages = {name for name in graph if name in targets or name.partition("@")[0] in targets}
    assert {target for target in targets if target not in stages} <= {n.partition("@")[0] for n in stages}
    return stages.union(*(nx.descendants(graph, name) for name in stages))


def test_branches_need_in_common_only_what_ran_before(graph, branches):
    shared = reached(graph, SHARED)
    for one, other in combinations(branches, 2):
        assert one & other <= shared


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
