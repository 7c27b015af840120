"""One change makes stale what it changes, in the pipeline's own graph."""

import re

import numpy as np
import pytest

from pedpred.config import read_params
from pedpred.errors import ValueRuleError
from tests.configuration import stages
from tests.conftest import ROOT
from tools import pipeline_picture, staleness
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
OTHERS = {
    "code",
    "config",
    "fetch",
    "ingest",
    "simulate",
    "validate_simulation",
    "evaluate_baseline",
    "ingest_literature",
}
ROBOTS = {"export", "drive"}
ALL = LSTM | MIXTURE | LITERATURE | LITERATURE_STEPS | PAGES | OTHERS | ROBOTS


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


def test_a_range_of_the_worlds_changes_who_is_simulated_there(graph):
    """Stages read it from the file of the part that it is in."""
    worlds = {"sequences", "situations_simulated", "far_worlds", "far_steps"}
    stale = families(graph, "worlds.people.usual_mps")
    assert worlds | {"train_main", "train_situations", "train_far", "train_far_steps"} <= stale
    assert not stale & {"simulate", "ingest", "features_real", "evaluate_baseline", "pretrain_autoencoder"}


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


def test_a_network_in_the_table_of_the_field_retrains_no_other(graph):
    """A setting of its training, there or in simulation."""
    measured = {"evaluate_literature", "gather_literature", "report"}
    stale = families(graph, "literature.networks.lstm.worlds.lr")
    assert stale == {"train_far_steps", "train_literature_steps"} | measured
    stale = families(graph, "literature.memoryless.mixture.recorded.lr")
    assert stale == {"train_literature"} | measured


def test_forces_fitted_to_real_people_change_no_simulation_and_no_training(graph):
    params = read_params(ROOT)
    fitted = set(params.social_forces) - {row.social_force for row in params.simulations.values()}
    assert fitted
    evaluated = {"evaluate_baseline", "evaluate_main", "evaluate_fold"}
    evaluated |= {"evaluate_main_situations", "evaluate_fold_situations", "validate_simulation"}
    for name in fitted:
        assert families(graph, f"social_forces.{name}") <= evaluated | PAGES


def test_every_family_belongs_to_one_model_or_to_all(graph):
    assert {family(stage.name) for stage in graph} == ALL


def test_no_result_is_recorded_of_a_stage_that_is_gone(graph):
    """`python -m tools.mend_lock` drops what DVC keeps, and reads and writes after every stage."""
    recorded = re.findall(r"(?m)^  (\S.*):$", (ROOT / "dvc.lock").read_text())
    assert set(recorded) <= {stage.name for stage in graph}


def test_a_change_that_nothing_reads_is_refused(graph):
    with pytest.raises(ValueRuleError, match=r"README\.md"):
        stale(graph, "README.md")


@pytest.mark.parametrize(
    "change", ["conf", "conf/worlds/varied.yaml", "conf/folds", "conf/driven", "conf/config.yaml"]
)
def test_what_params_are_composed_of_is_changed_by_its_keys(graph, change):
    with pytest.raises(ValueRuleError, match=r"params\.yaml is composed of it: name the key that changes"):
        stale(graph, change)


def test_a_file_of_conf_that_stages_read_themselves_is_a_change(graph):
    assert "report" in families(graph, "conf/ablations")
    assert "simulate" in families(graph, "conf/layouts")


@pytest.mark.parametrize("change", ["", "features.lstm.gird_cells", "features[", "features..lstm", "..."])
def test_what_is_neither_a_file_nor_a_key_is_refused_as_such(graph, change, tmp_path, monkeypatch):
    (tmp_path / "params.yaml").write_text("features: {lstm: {grid_cells: 3, rest: null}}")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueRuleError, match=r"change = .*, but there is no such file or key"):
        stale(graph, change)


def test_a_key_may_hold_nothing(graph, tmp_path, monkeypatch):
    (tmp_path / "params.yaml").write_text("features: {lstm: {grid_cells: null}}")
    monkeypatch.chdir(tmp_path)
    assert stale(graph, "features.lstm.grid_cells")


@pytest.mark.parametrize("path", ["pedpred/report/tables.py", "pedpred/models"])
def test_a_path_means_the_same_however_it_is_written(graph, path):
    written = (ROOT / path, f"../{ROOT.name}/{path}", f"{path}/", f"tests/../{path}")
    assert all(stale(graph, str(other)) == stale(graph, path) for other in written)


@pytest.mark.parametrize(
    ("whole", "parts"),
    [
        ("training", ["training.main", "training.finetune"]),
        ("methods.networks.lstm", ["methods.networks.lstm.settings", "methods.networks.lstm.where"]),
        ("pedpred", ["pedpred/report", "pedpred/models"]),
        (".", ["pedpred", "stages", "params.yaml"]),
        ("./pedpred/report/tables.py", ["pedpred/report/tables.py"]),
    ],
)
def test_a_change_of_the_whole_makes_stale_what_a_change_of_a_part_does(graph, whole, parts):
    assert set().union(*(stale(graph, part) for part in parts)) <= stale(graph, whole)


def test_the_page_shows_the_pipeline_as_it_is(graph):
    """`make readme` writes it."""
    page = (ROOT / staleness.PAGE).read_text()
    assert filled(page, staleness.marked(graph)) == page


def test_the_picture_is_the_same_each_time(graph):
    """The layout iterates over sets, whose order must not follow addresses in memory."""
    flow, kept = staleness.families(graph), []
    for _ in range(8):
        kept.append(pipeline_picture.Layout(flow))  # keeps its addresses
    assert all((one.at, one.arrows) == (kept[0].at, kept[0].arrows) for one in kept)


def test_the_picture_shows_every_family_but_the_check(graph):
    flow = staleness.families(graph)
    assert ("train_main", "finetune") in flow.edges
    assert set(flow) == ALL - {"code", "config"}


def test_arrows_of_the_picture_go_to_the_right_around_all_boxes(graph):
    flow = staleness.families(graph)
    layout = pipeline_picture.Layout(flow)
    middles = np.array([layout.at[name] for name in flow])
    sides = np.array([pipeline_picture.size_of(name) for name in flow]) / 2 - 1
    apart = np.abs(middles[:, None] - middles) > sides[:, None] + sides
    assert (apart.any(axis=-1) | np.eye(len(flow), dtype=bool)).all()
    assert len(layout.arrows) == len(flow.edges)
    for arrow in map(np.array, layout.arrows):
        along = np.linspace(0, 1, 200)[:, None, None]
        points = (arrow[:-1] + along * np.diff(arrow, axis=0)).reshape(-1, 2)
        assert (np.diff(arrow[:, 0]) >= 0).all()
        assert not (np.abs(points[:, None] - middles) < sides).all(axis=-1).any()
    texts = {text.get_text() for text in pipeline_picture.draw_families(flow).axes[0].texts}
    assert texts == {name.replace("_", "\n") for name in flow}
