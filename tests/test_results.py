"""Tables and sentences state the figures of the metric files, for any selection of places and methods."""

import json
import re
from dataclasses import replace

import pytest

from pedpred.errors import ValueRuleError
from pedpred.metrics import METRICS, Metric
from pedpred.report.document import markdown_table
from pedpred.report.findings import judge_expectations, sum_up
from pedpred.report.gather import Evaluated, study_page
from pedpred.report.methods import Method
from pedpred.report.places import places_section, places_table, ratios_table, relative_errors
from pedpred.report.results import read_metrics, results_frame, results_of
from pedpred.report.sections import answer
from pedpred.report.tables import calibration_table, further_table, metrics_table, steps_table
from pedpred.settings import load
from tests.forecasts import METHODS, PAPER
from tests.refused import unread
from tests.reports import MEETING, STEPS, metrics_of, result_of, room

SIMULATED = [{"test": ["simulated/sim_test"]}]


def cells_of(table):
    """Rows of a Markdown table by their first cell, without emphasis of that."""
    rows = [row.strip("| ").split(" | ") for row in table.markdown("").splitlines()]
    return {row[0].strip("*"): row[1:] for row in rows if set(row[0]) != {"-"}}


def page_of(key, results, pictures=()):
    kind = {"sim": "simulated", "real": "real"}[key]
    return study_page(Evaluated(key, kind, results, {}, {}, {}, None), pictures, METHODS, PAPER).markdown(key)


# The table of results


def test_every_figure_of_a_metric_file_is_a_row():
    metrics = {"eth": metrics_of(MEETING)}
    frame = results_frame({"real": metrics, "walking": {"main": {"states": 3}}, "latency": {"updates": [1]}})
    for row in frame.itertuples():
        found = metrics[row.place][row.method][row.figure]
        assert row.value == (found[row.step - 1] if row.step else found)
    values = [v for own in metrics["eth"].values() for k, v in own.items() if not k.endswith("_ci95")]
    assert len(frame) == sum(len(value) if isinstance(value, list) else 1 for value in values)
    assert set(frame["study"]) == {"real"}


def test_figure_keeps_its_interval_and_a_null_has_no_row():
    own = {"ade_m": 0.5, "ade_m_ci95": [0.4, 0.6], "nll": None, "fde_m": 1.0, "fde_m_ci95": [None, None]}
    figures = result_of({"cv": own}).figures
    assert [figures.get("cv", f) for f in ("ade_m", "fde_m", "nll")] == [(0.5, (0.4, 0.6)), (1.0, None), None]


def test_results_without_a_needed_figure_are_refused(tmp_path):
    path = tmp_path / "sim.json"
    scenes = {"sim_test": metrics_of(MEETING)}
    path.write_text(json.dumps(scenes))
    assert read_metrics(path) == scenes
    del scenes["sim_test"]["cv"]["tracks"]
    path.write_text(json.dumps(scenes))
    with unread(path):
        read_metrics(path)
    with pytest.raises(ValueRuleError):
        results_of({"eth": metrics_of(MEETING)}, SIMULATED, "sim", 0.3)


def test_parts_belong_to_the_longest_name_that_fits():
    sets = dict.fromkeys(("hall", "hall_wide", "hall_wide_a", "hall_b"), metrics_of(MEETING))
    folds = [{"test": [f"real/{name}"]} for name in ("hall", "hall_wide")]
    assert [list(result.parts) for result in results_of(sets, folds, "real", 0.3)] == [["b"], ["a"]]


def test_methods_refer_to_methods_of_the_right_kind():
    ((part, whole),) = METHODS.ablations
    assert (part.role, whole.role) == ("ablation", "network")
    for row, of in ((part, ""), (whole, "cv")):
        with pytest.raises(ValueRuleError):
            load(Method, vars(row) | {"of": of}, f"methods.{row.key}")
    with pytest.raises(ValueRuleError):
        replace(METHODS, reference=METHODS["lstm"])


# Expectations


def judged(metrics, train=()):
    return [finding for _, finding in judge_expectations(result_of(metrics, train=train), PAPER, METHODS)]


@pytest.mark.parametrize(
    ("changed", "missed"),
    [
        ({}, []),
        ({"social_force": 0.41}, ["SF, true goal below LSTM"]),
        ({"lstm": 0.51}, ["LSTM below LSTM-noGrid", "LSTM-noGrid / LSTM at least 1.15"]),
        ({"lstm_nogrid": 0.61}, ["LSTM-noGrid below Kalman CV"]),
    ],
)
def test_expectations_are_met_or_missed(changed, missed):
    found = judged(metrics_of(MEETING | changed))
    assert [finding.claim for finding in found if finding.verdict == "missed"] == missed
    assert sum_up([("here", finding) for finding in found]).startswith("**" if missed else "All")


@pytest.mark.parametrize(
    ("lstm", "spread_m", "verdict", "shown"),
    [(0.594, 0.001, "met", "1.0 %"), (0.610, 0.001, "missed", "1.7 %"), (0.595, 0.02, None, "includes 0")],
)
def test_gain_is_judged_by_its_interval(lstm, spread_m, verdict, shown):
    """In both directions; where the interval includes 0, the sentence claims no difference."""
    metrics = metrics_of(MEETING | {"lstm": lstm}, spread_m)
    *_, gain = judged(metrics, train=["real/home"])
    assert shown in gain.measured
    assert verdict in (None, gain.verdict)
    assert ("not distinguishable" in answer(result_of(metrics), METHODS)) == (verdict is None)


def test_method_without_figures_is_not_judged():
    assert {finding.verdict for finding in judged(metrics_of({"cv": 0.7, "kalman_cv": 0.6}))} == {
        "not measured"
    }


# Tables of a test set


def test_tables_hold_figures_and_intervals():
    result = result_of(metrics_of(MEETING))
    rows = cells_of(metrics_table(result, METHODS))
    assert rows["CV"][:5] == ["0.700 (0.680 to 0.730)", "1.330", "0.770", "-", "1.23 %"]
    assert rows["CV"][5:] == ["20.00 %", "+0.100 (+0.090 to +0.110)"]
    assert rows["Kalman CV"][-1] == "-"
    covered = cells_of(calibration_table(result, METHODS))
    assert covered["LSTM"] == ["51 / 51 / 51", "91 / 91 / 91", "96 / 96 / 96", "-4.00 / -1.33 / 2.00"]
    assert calibration_table(result_of(metrics_of({"cv": 1.0, "kalman_cv": 0.5})), METHODS) is None
    ahead = cells_of(steps_table(result, METHODS))
    assert ahead["method"] == [f"{0.3 * step:.1f} s" for step in range(1, STEPS + 1)]
    assert ahead["LSTM"][-1] == "0.760 (0.380, 0.760, 1.140)"


def test_bar_in_a_cell_adds_no_column():
    lines = markdown_table(["a|b", "|", "eth"], [["|", "1", "||"]]).split("\n")
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in lines} == {4}


def test_every_metric_is_in_one_table(monkeypatch):
    monkeypatch.setitem(METRICS, "toy_share", Metric("toy", "%", "higher", None))
    metrics = metrics_of({"cv": 0.7, "kalman_cv": 0.6, "lstm": 0.4})
    for own in metrics.values():
        own |= {"min_ade_m_k3": 0.9 * own["ade_m"], "min_ade_m_k6": own["ade_m"], "toy_share": 0.5}
    result = result_of(metrics)
    further = cells_of(further_table(result, METHODS))
    assert further["method"] == ["minADE3 [m]", "toy"]
    assert (further["CV"], further["Kalman CV"]) == (["0.630", "50.00 %"], ["0.540", "50.00 %"])
    assert "minADE6 [m]" not in metrics_table(result, METHODS).header  # it repeats the ADE
    metrics["lstm"] |= {"min_ade_m_k6": 0.3, "mode_collision_share": 0.1}
    first = cells_of(metrics_table(result_of(metrics), METHODS))
    assert first["method"][2:5] == ["minADE6 [m]", "ADE moving [m]", "NLL [nats]"]
    assert first["LSTM"][2:8] == ["0.300", "0.440", "0.50", "1.23 %", "20.00 %", "10.00 %"]


# Pages


@pytest.mark.parametrize(("key", "train"), [("sim", []), ("real", ["real/home"])])
def test_noncausal_figures_are_marked_before_the_first_table(key, train):
    metrics = metrics_of(MEETING)
    marked = {name: own | {"noncausal": True} for name, own in metrics.items()}
    heads = [page_of(key, [result_of(m, train=train)]).partition("|")[0] for m in (metrics, marked)]
    assert ["Non-causal" in head for head in heads] == [False, True]


# Real places side by side


def at_places(study, errors_m, missing=()):
    """Figures at two places; `errors_m`: place -> the LSTM's ADE there, m."""
    metrics = {place: metrics_of(MEETING | {"lstm": ade}) for place, ade in errors_m.items()}
    trained = {"train": ["real/barn"]} if study == "real" else {}
    folds = [{"test": [f"real/{place}"]} | trained for place in ("hall", "yard")]
    return results_of(metrics, folds, study, 0.3, missing)


STUDIES = {
    "transfer": at_places("transfer", {"hall": 0.3, "yard": 0.72}),
    "real": at_places("real", {"hall": 0.33, "yard": 0.5}),
}


def test_errors_are_relative_to_the_best_simple_method():
    (hall, _) = STUDIES["transfer"]
    found = relative_errors([hall], METHODS).set_index("method").loc["lstm"]
    assert found["ratio"] == pytest.approx(0.3 / min(MEETING[key] for key in ("cv", "ca", "kalman_cv")))
    assert (found["share"], found["named"]) == (0.0123, True)
    rooms = dict.fromkeys(("set", "set_a", "set_b"), metrics_of(MEETING))
    pooled = relative_errors(results_of(rooms, [{"test": ["simulated/set"]}], "sim", 0.3), METHODS)
    assert pooled["place"].unique().tolist() == ["set_a", "set_b"]


def test_network_has_a_column_per_training():
    table = cells_of(places_table(STUDIES, "ade_m", METHODS))
    assert table["ADE [m]"] == [
        *("CV", "CA", "Kalman CV", "SF, true goal"),
        *("LSTM-noGrid, simulated", "LSTM-noGrid, tuned", "LSTM, simulated", "LSTM, tuned"),
    ]
    assert table["hall"][-2:] == ["0.300 (0.280 to 0.330)", "0.330 (0.310 to 0.360)"]
    assert table["yard"][0] == "0.700 (0.680 to 0.730)"
    ratios = cells_of(ratios_table(STUDIES, METHODS))
    assert ratios["yard"] == ["0.600 (0.580 to 0.630)", "1.20", *["**0.83**"] * 3, "1.00"]


def section_of(results, missing=None, scenes=None):
    evaluated = Evaluated("transfer", "real", results, scenes or {}, {}, {}, None, missing or {})
    return places_section([evaluated], METHODS), evaluated


def test_missing_place_is_listed_with_how_to_get_it():
    section, _ = section_of(at_places("transfer", {"hall": 0.3}, ["real/yard"]), {"yard": "ask for it"})
    assert "| yard | ask for it |" in section.markdown("")
    nothing, _ = section_of([], {"hall": "ask", "yard": "ask"})
    assert not list(nothing.pictures)


def test_stand_ins_are_not_called_real():
    found = results_of({"hall": metrics_of(MEETING)}, [{"train": [], "test": ["real/hall"]}], "real", 0.3)
    section, evaluated = section_of(found, scenes={"hall": [replace(room(), stand_in="drawn by hand")]})
    text = section.markdown("places") + study_page(evaluated, [], METHODS, PAPER).markdown("real")
    assert text.count("drawn by hand") >= 2
    assert not [words for words in ("eal places", "never saw", "fine-tuned") if words in text]


@pytest.mark.parametrize("exact", [{"kalman_cv"}, set(MEETING)])
def test_exact_forecasts_have_pages(exact):
    metrics = metrics_of(MEETING)
    for figures in (metrics[method] for method in exact):
        figures |= {key: 0.0 for key, value in figures.items() if isinstance(value, float)}
        figures |= {key: [0.0] * len(value) for key, value in figures.items() if isinstance(value, list)}
    section, evaluated = section_of(results_of({"hall": metrics}, [{"test": ["real/hall"]}], "transfer", 0.3))
    assert study_page(evaluated, [], METHODS, PAPER).markdown("")
    assert section.blocks
