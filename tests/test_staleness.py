"""One change makes stale what it changes, in the pipeline's own graph."""

import pytest

from pedpred.config import read_params
from tests.configuration import stages
from tests.conftest import ROOT
from tools import staleness
from tools.readme import filled
from tools.staleness import family, stale

pytestmark = pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")  # of DVC
LSTM = {"pretrain_autoencoder", "encode_simulated", "encode_real", "train_corridor", "train_main", "finetune"}
LSTM |= {"features_simulated", "features_real", "sequences", "evaluate_main", "evaluate_fold"}
MIXTURE = {
    "situations_simulated",
    "situations_real",
    "train_situations",
    "finetune_situations",
    "train_robot",
}
MIXTURE |= {"evaluate_main_situations", "evaluate_fold_situations"}
LITERATURE = {"far_worlds", "literature_windows", "train_far", "train_literature", "evaluate_literature"}
LITERATURE |= {"gather_literature"}
LITERATURE_STEPS = {
    "far_steps",
    "literature_steps",
    "encode_far",
    "train_far_steps",
    "train_literature_steps",
}
LITERATURE_STEPS |= {"evaluate_literature", "gather_literature"}
PAGES = {"gather", "record", "report"}
ROBOTS = {"export", "drive"}


@pytest.fixture(scope="module")
def graph():
    return stages()


def families(graph, change):
    return {family(name) for name in stale(graph, change)}


@pytest.mark.parametrize("change", ["grid_cells", "grid_resolution_m", "angular_cells"])
def test_the_inputs_of_the_lstm_are_its_own(graph, change):
    assert families(graph, f"features.lstm.{change}") == LSTM | LITERATURE_STEPS | PAGES | ROBOTS


@pytest.mark.parametrize("change", ["beams", "neighbours"])
def test_the_inputs_of_the_mixture_are_its_own(graph, change):
    assert families(graph, f"features.mixture.{change}") == MIXTURE | LITERATURE | PAGES | ROBOTS


@pytest.mark.parametrize("change", ["label", "colour"])
def test_a_look_changes_what_people_look_at(graph, change):
    assert families(graph, f"report.methods.lstm.{change}") == {"record", "report"}


@pytest.mark.parametrize("group", ["networks", "memoryless"])
def test_a_network_costs_its_own_trainings_and_evaluations(graph, group):
    rows = read_params(ROOT).methods[group]
    for name in rows:
        names = stale(graph, f"methods.{group}.{name}.settings.architecture")
        learning = {own for own in names if family(own) in LSTM | MIXTURE}
        assert learning
        for own in learning:
            assert own.partition("@")[2].partition("-")[0] == name


def test_forces_fitted_to_real_people_change_no_training(graph):
    params = read_params(ROOT)
    fitted = set(params.social_forces) - {row.social_force for row in params.simulations.values()}
    assert fitted
    evaluated = {"evaluate_baseline", "evaluate_main", "evaluate_fold"}
    evaluated |= {"evaluate_main_situations", "evaluate_fold_situations", "validate_simulation"}
    for name in fitted:
        assert families(graph, f"social_forces.{name}") <= evaluated | PAGES


def test_the_page_shows_the_pipeline_as_it_is(graph):
    """`make readme` writes it."""
    page = (ROOT / staleness.PAGE).read_text()
    assert filled(page, staleness.marked(graph)) == page
