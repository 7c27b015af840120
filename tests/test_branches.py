"""The branches that `tools.branches` rebuilds side by side need nothing of each other."""

from itertools import combinations

import networkx as nx
import pytest
from omegaconf import OmegaConf

from tests import configuration
from tests.conftest import ROOT
from tools.branches import SHARED, branches, needed, stage_names

LONG = ("pretrain", "train", "finetune", "evaluate")
pytestmark = pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")  # of DVC


@pytest.fixture(scope="module")
def graph():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tools.branches.pipeline", lambda _: configuration.stages())
        return stage_names(ROOT)


@pytest.fixture(scope="module")
def stages(graph):
    """Names of the stages of each branch, in the order in which they run."""
    params = OmegaConf.create(configuration.read("params.yaml"))
    return {name: needed(graph, last) for name, last in branches(params).items()}


def test_stages_come_after_those_that_they_need(graph, stages):
    order = stages["lstms"]
    assert {"ingest@eth", "train_main@lstm", "validate_simulation"} < set(order)
    assert "train_situations@mixture" not in order
    for name in order:
        assert nx.descendants(graph, name) <= set(order[: order.index(name)])


def test_branches_need_in_common_only_what_ran_before(graph, stages):
    for one, other in combinations(stages.values(), 2):
        assert set(one) & set(other) <= set(needed(graph, SHARED))


def test_every_training_and_evaluation_is_in_one_of_them(graph, stages):
    assert {name for name in graph if name.startswith(LONG)} <= set().union(*stages.values())
