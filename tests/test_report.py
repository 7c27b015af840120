"""The report says what the numbers say, shows what its rule picks, and draws things where they are."""

import dataclasses
import io
import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from PIL import Image

from pedpred.errors import InputError, ValueRuleError
from pedpred.geometry import Homography, rotate
from pedpred.metrics import METRICS, Metric
from pedpred.metrics.calibration import radius2, share_inside, squared_mahalanobis
from pedpred.models.lstm.autoencoder import GridAutoencoder
from pedpred.models.lstm.features.grids import occupancy_crops
from pedpred.report.canvas import avif_bytes, png_bytes
from pedpred.report.curves import by_stage, training_figure
from pedpred.report.document import Picture, Pictures, Section, join_pages, markdown_table
from pedpred.report.error_plots import horizon_figure, horizon_table
from pedpred.report.findings import Expectation, judge_expectations, sum_up
from pedpred.report.gallery import Evaluated, draw_gallery
from pedpred.report.gather import scene_names, study_page
from pedpred.report.instants import Instant, choose
from pedpred.report.measures import read_metrics, results_of
from pedpred.report.methods import Method
from pedpred.report.plan import contact_sheet, obstacle_image, quarter_turns_of, turn_points
from pedpred.report.reconstructions import choose_evenly, reconstruct
from pedpred.report.regions import ellipse_outline, region_outlines
from pedpred.report.sections import answer
from pedpred.report.situation import draw_situation
from pedpred.report.snapshots import angular_cell_edges, draw_angular_grid, grid_image
from pedpred.report.tables import calibration_table, further_table, gap_cell, metric_cell, metrics_table
from pedpred.scenes import Camera, OccupancyMap, Predictions, Scene, Trajectories
from pedpred.settings import load
from tests.forecasts import METHODS, PAPER, windows_with

STEPS = 10
MEETING = {"cv": 0.70, "ca": 0.80, "kalman_cv": 0.60, "social_force": 0.07, "lstm_nogrid": 0.50, "lstm": 0.40}
SIMULATED = [{"test": ["simulated/sim_test"]}]


def measures(ade_m, gap_m=None, spread_m=0.01):
    steps = np.linspace(0.1, 1.9, STEPS) * ade_m
    found = {"ade_m": ade_m, "ade_m_ci95": [ade_m - 0.02, ade_m + 0.03], "fde_m": 1.9 * ade_m}
    found |= {"moving_ade_m": 1.1 * ade_m, "windows": 1234, "tracks": 56, "per_step_m": steps.tolist()}
    found |= {f"per_step_q{q}_m": (steps * q / 50).tolist() for q in (25, 50, 75)}
    found |= {"obstacle_share": 0.0123, "collision_share": 0.2}
    if gap_m is not None:
        found["ade_m_minus_reference"] = gap_m
        found["ade_m_minus_reference_ci95"] = [gap_m - spread_m, gap_m + spread_m]
    return found


def metrics_of(errors_m, spread_m=0.01):
    reference = errors_m.get("kalman_cv", 0.0)
    found = {name: measures(ade, ade - reference, spread_m) for name, ade in errors_m.items()}
    if "lstm" in found:
        covered = {f"per_step_coverage_{p}": [p / 100 + 0.01] * STEPS for p in (50, 90, 95)}
        found["lstm"] |= {"nll": 0.5, "per_step_nll": np.linspace(-4.0, 2.0, STEPS).tolist(), **covered}
    return found


def result_of(metrics, name=None, train=()):
    """The result of one test set: a simulated one when nothing was trained for it."""
    study, kind, usual = ("real", "real", "eth") if train else ("sim", "simulated", "sim_test")
    name = name or usual
    return results_of({name: metrics}, [{"train": train, "test": [f"{kind}/{name}"]}], study, 0.3)[0]


def judged(metrics, train=()):
    return [finding for _, finding in judge_expectations(result_of(metrics, train=train), PAPER, METHODS)]


def document_of(key, results, pictures=()):
    """A page with other pictures than those of the gallery."""
    kind = {"sim": "simulated", "real": "real"}[key]
    return study_page(Evaluated(key, kind, results, {}, {}, {}, None), pictures, METHODS, PAPER).markdown(key)


# Words


def test_met_expectations_are_called_met():
    found = judged(metrics_of(MEETING))
    assert [finding.verdict for finding in found] == ["met"] * 4
    assert "All 4 expectations" in sum_up([("here", finding) for finding in found])


def test_an_expectation_of_an_unknown_kind_is_refused():
    with pytest.raises(ValueRuleError, match="kind = 'equal'"):
        Expectation("equal", "lstm", "cv")


@pytest.mark.parametrize(
    ("changed", "missed"),
    [
        ({"social_force": 0.41}, "SF, true goal below LSTM"),
        ({"lstm": 0.51}, "LSTM below LSTM-noGrid"),
        ({"lstm_nogrid": 0.61}, "LSTM-noGrid below Kalman CV"),
        ({"lstm": 0.45}, "LSTM-noGrid / LSTM at least 1.15"),
    ],
)
def test_a_missed_expectation_is_named(changed, missed):
    found = judged(metrics_of(MEETING | changed))
    assert missed in [finding.claim for finding in found if finding.verdict == "missed"]
    text = sum_up([("here", finding) for finding in found])
    assert "missed" in text
    assert missed in text
    assert "All" not in text


@pytest.mark.parametrize(
    ("lstm", "verdict", "words"),
    [(0.594, "met", "1.0 % better"), (0.610, "missed", "1.7 % worse"), (0.500, "met", "16.7 % better")],
)
def test_the_gain_on_real_people_is_judged_in_both_directions(lstm, verdict, words):
    metrics = metrics_of(MEETING | {"lstm": lstm}, spread_m=0.001)
    *_, below_cv, gain = judged(metrics, train=["real/home"])
    assert (below_cv.verdict, gain.verdict) == ("met", verdict)
    assert gain.measured == words
    assert f"{words} than the Kalman CV's 0.600 m" in answer(result_of(metrics), METHODS)


def test_real_people_are_expected_to_be_forecast_as_well_as_the_paper_says():
    """Better than social forces and than without the grid, too: both were missing from what is judged."""
    claims = {finding.claim: finding.verdict for finding in judged(metrics_of(MEETING), train=["real/home"])}
    assert claims["LSTM below SF, true goal"] == "missed"
    assert claims["LSTM below LSTM-noGrid"] == "met"


def test_a_difference_within_the_noise_is_said_to_be():
    metrics = metrics_of(MEETING | {"lstm": 0.595}, spread_m=0.02)
    assert "not distinguishable from the Kalman CV's" in answer(result_of(metrics), METHODS)
    assert "includes 0" in judged(metrics, train=["real/home"])[-1].measured
    assert "not distinguishable" not in answer(result_of(metrics_of(MEETING)), METHODS)


def test_what_was_not_evaluated_is_not_judged():
    metrics = metrics_of({"cv": 0.7, "kalman_cv": 0.6})
    found = [("here", finding) for finding in judged(metrics)]
    assert {finding.verdict for _, finding in found} == {"not measured"}
    assert "could be checked" in sum_up(found)
    assert "was not evaluated" in answer(result_of(metrics), METHODS)


@given(st.lists(st.sampled_from(["a|b", "|", "eth", "1"]), min_size=3, max_size=3))
def test_a_name_with_a_bar_does_not_break_a_table(cells):
    lines = markdown_table(cells, [cells]).split("\n")
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in lines} == {4}


def test_a_figure_without_an_interval_stands_alone():
    unknown = {key: 0.5 for key in ("moving_ade_m", "ade_m_minus_reference")}
    unknown |= {f"{key}_ci95": [None, None] for key in unknown}
    assert metric_cell("here", "lstm", "moving_ade_m", unknown).tip == ""
    assert gap_cell("here", "lstm", unknown, METHODS).text == "-"


def test_a_table_row_holds_its_figures():
    table = metrics_table(result_of(metrics_of(MEETING)), METHODS).markdown("")
    rows = {row.split(" | ")[0].strip("|* "): row for row in table.splitlines()}
    cells = rows["CV"].strip("| ").split(" | ")
    assert cells[1:6] == ["0.700 (0.680 to 0.730)", "1.330", "0.770", "-", "1.23 %"]
    assert cells[6:] == ["20.00 %", "+0.100 (+0.090 to +0.110)"]
    assert rows["Kalman CV"].endswith("| - |")
    assert {row.count(" | ") for row in table.splitlines()} == {7}


def test_every_metric_is_shown_once(monkeypatch):
    monkeypatch.setitem(METRICS, "toy_share", Metric("toy", "%", "higher", None))
    metrics = metrics_of({"cv": 0.7, "kalman_cv": 0.6, "lstm": 0.4})
    for own in metrics.values():
        own |= {"min_ade_m_k3": 0.9 * own["ade_m"], "min_ade_m_k6": own["ade_m"], "toy_share": 0.5}
    result = result_of(metrics)
    rows = further_table(result, METHODS).markdown("").splitlines()
    assert rows[0] == "| method | minADE3 [m] | toy |"
    assert rows[2:4] == ["| CV | 0.630 | 50.00 % |", "| Kalman CV | 0.540 | 50.00 % |"]
    assert "minADE6" not in metrics_table(result, METHODS).markdown("")  # it repeats the ADE
    metrics["lstm"] |= {"min_ade_m_k6": 0.3, "mode_collision_share": 0.1}
    header, _, cv, *_, lstm = metrics_table(result, METHODS).markdown("").splitlines()
    assert header.startswith(
        "| method | ADE [m] | FDE [m] | minADE6 [m] | ADE moving [m] | NLL [nats] | in obst"
    )
    assert "| collisions | collisions of most likely modes |" in header
    assert "| 0.700 | 0.770 | - | 1.23 % | 20.00 % | - |" in cv
    assert "| 0.300 | 0.440 | 0.50 | 1.23 % | 20.00 % | 10.00 % |" in lstm


def test_the_table_of_regions_has_three_steps_of_methods_with_covariances():
    rows = calibration_table(result_of(metrics_of(MEETING)), METHODS).markdown("").split("\n")
    assert rows[0].startswith("| after 0.3 / 1.5 / 3.0 s | in the 50 % region [%] |")
    assert rows[2:] == ["| **LSTM** | 51 / 51 / 51 | 91 / 91 / 91 | 96 / 96 / 96 | -4.00 / -1.33 / 2.00 |"]
    assert calibration_table(result_of(metrics_of({"cv": 1.0, "kalman_cv": 0.5})), METHODS) is None


@pytest.mark.parametrize("share", [0.5, 0.9, 0.95])
def test_an_ellipse_is_drawn_where_its_share_ends(share):
    centre, covariance = np.array([3.0, -1.0]), np.array([[0.5, 0.2], [0.2, 0.3]])
    outline = ellipse_outline(centre, covariance, share)
    np.testing.assert_allclose(squared_mahalanobis(outline - centre, covariance), radius2(share))


def test_methods_keep_order_and_colour_whoever_else_is_there():
    assert METHODS.ordered(["zebra", "lstm", "cv", "aaa"]) == ["cv", "lstm", "aaa", "zebra"]
    for shown in ("colour", "label"):
        assert len({getattr(method, shown) for method in METHODS}) == len(METHODS.rows)


def test_an_ablation_names_the_network_that_it_is_an_ablation_of():
    ((part, whole),) = METHODS.ablations
    assert (part.role, whole.role) == ("ablation", "network")
    for row, of in ((part, ""), (whole, "cv")):
        with pytest.raises(ValueRuleError, match=rf"methods\.{row.key}\.of = '{of}'"):
            load(Method, vars(row) | {"of": of}, f"methods.{row.key}")
    rows = [replace(row, of="cv") if row is part else row for row in METHODS]
    with pytest.raises(ValueRuleError, match=rf"of = 'cv', but the networks are \['{whole.key}'"):
        replace(METHODS, rows=tuple(rows))


def test_the_reference_is_a_simple_method():
    assert METHODS.reference in METHODS.simple
    for key in ("lstm", "zebra"):
        with pytest.raises(ValueRuleError, match=f"reference = '{key}'"):
            replace(METHODS, reference=METHODS[key])


def test_simple_methods_are_named_whatever_their_number():
    rows = [row for row in METHODS.rows if row not in METHODS.simple]
    kept = dataclasses.replace(METHODS, rows=(*rows, METHODS.reference))
    assert METHODS.best_simple == "the best of CV, CA and Kalman CV"
    assert kept.best_simple == "Kalman CV"


def test_a_method_without_a_row_is_shown_by_its_key():
    assert (METHODS["zebra"].label, METHODS["zebra"].role) == ("zebra", "other")


@pytest.mark.parametrize(("key", "train"), [("sim", []), ("real", ["real/home"])])
def test_a_page_of_noncausal_figures_says_so_first(key, train):
    metrics = metrics_of(MEETING)
    causal = document_of(key, [result_of(metrics, train=train)])
    marked = {name: own | {"noncausal": True} for name, own in metrics.items()}
    marked = document_of(key, [result_of(marked, train=train)])
    assert "nothing on this page is a forecast" not in causal
    assert "nothing on this page is a forecast" in marked.partition("|")[0]


def test_a_place_is_no_scene_of_another_whose_name_it_begins_with():
    sets = dict.fromkeys(("hall", "hall_wide", "hall_wide_a", "hall_b"), metrics_of(MEETING))
    folds = [{"test": [f"real/{name}"]} for name in ("hall", "hall_wide")]
    assert [list(result.parts) for result in results_of(sets, folds, "real", 0.3)] == [["b"], ["a"]]


def test_the_page_on_simulation_lists_single_scenes_and_pictures():
    metrics, worse = metrics_of(MEETING), metrics_of(MEETING | {"lstm": 0.65})
    sets = {"sim_test": metrics, "sim_test_office": metrics, "sim_test_g0": worse}
    results = results_of(sets, SIMULATED, "sim", 0.3)
    pictures = [Picture(f"p{k}", f"caption {k}", Figure()) for k in range(3)]
    page = document_of("sim", results, [Section("Look", [Pictures(pictures, columns=2)])])
    assert page.startswith("# Simulation")
    assert "| office | 1234 |" in page
    assert "LSTM below Kalman CV in 1 of 2; LSTM below LSTM-noGrid in 1 of 2." in page
    assert "![p2](sim/p2.png)<br>caption 2" in page
    with pytest.raises(ValueRuleError, match="sim_test"):
        results_of({"eth": metrics}, SIMULATED, "sim", 0.3)


def test_the_page_on_real_people_names_all_folds_and_what_cannot_be_reproduced():
    folds = [{"train": ["real/hotel", "real/zara"], "test": ["real/eth"]}]
    folds += [{"train": ["real/eth", "real/zara", "real/corner", "simulated/main"], "test": ["real/hotel"]}]
    sets = {"eth": metrics_of(MEETING), "hotel": metrics_of(MEETING)}
    page = document_of("real", results_of(sets, folds, "real", 0.3))
    assert "At eth (fine-tuned on hotel and zara)" in page
    assert "At hotel (fine-tuned on 3 other recordings)" in page
    assert "could not be reproduced" in page


def test_joined_pages_keep_their_links_and_lower_their_headings():
    page = join_pages(["# One\n\n![a](sim/a.png)\n", "# Two\n\n## Part\n"])
    headings = [row for row in page.split("\n") if row.startswith("#")]
    assert headings == ["# Report", "## One", "## Two", "### Part"]
    assert "![a](sim/a.png)" in page


def test_a_measure_that_is_missing_is_named(tmp_path):
    path = tmp_path / "sim.json"
    scenes = {"sim_test": metrics_of(MEETING)}
    path.write_text(json.dumps(scenes))
    assert read_metrics(path) == scenes
    del scenes["sim_test"]["cv"]["tracks"]
    path.write_text(json.dumps(scenes))
    with pytest.raises(InputError, match="sim_test/cv/tracks"):
        read_metrics(path)


# Pictures


def wall_scene(name="hall", camera=None):
    """A room of 20 m with a block; walkers cross it eastwards, one row each 0.3 s."""
    occupied = np.zeros((200, 200), dtype=bool)
    occupied[120:140, 40:60] = True
    times, tracks = np.meshgrid(np.arange(40) * 0.3, np.arange(6), indexing="ij")
    position = np.stack([2.0 + times + tracks * 0.1, 3.0 + 2.0 * tracks], axis=-1).reshape(-1, 2)
    trajectories = Trajectories(times.ravel(), tracks.ravel(), position)
    return Scene(name, trajectories, OccupancyMap(occupied, np.zeros(2), 0.1), 0.3, camera)


def planned(scene, walkers=5, planted_s=None):
    """Windows in which the LSTM is right at `planted_s` and as good as Kalman CV elsewhere."""
    instants, people = np.arange(8) * 0.3, np.arange(walkers)
    time_s, track = np.repeat(instants, walkers), np.tile(people, len(instants))
    rows = len(time_s)
    position = np.stack([2.0 + time_s + track * 0.1, 3.0 + 2.0 * track], axis=-1)
    ahead_s = (np.arange(STEPS) + 1) * 0.3
    truth = position[:, None] + np.stack([ahead_s, np.zeros(STEPS)], axis=-1)
    kalman = truth + np.stack([np.zeros(STEPS), 0.3 * ahead_s], axis=-1)
    right = np.zeros(rows, bool) if planted_s is None else np.abs(time_s - planted_s) < 1e-6
    lstm = np.where(right[:, None, None], truth, kalman)
    crops = occupancy_crops(scene.occupancy, position, np.zeros(rows), 60, 0.1)
    spread = np.tile(ahead_s[:, None, None] ** 2 * np.diag([0.04, 0.09]), (rows, 1, 1, 1))
    paths = {"kalman_cv": kalman, "lstm": lstm}
    own = {"track_id": track, "time_s": time_s, "packed_grid": crops}
    return windows_with(position, truth, paths, {"lstm": spread}, **own)


def test_the_rule_picks_the_planted_instant():
    plain, planted = wall_scene("plain"), wall_scene("planted")
    scenes = {"plain": planned(plain), "planted": planned(planted, planted_s=1.2)}
    found = choose(scenes, 4, METHODS)
    assert found.scene == "planted"
    assert found.time_s == pytest.approx(1.2)
    assert f"largest, {0.3 * 0.3 * 5.5:+.3f} m on average over 5 moving" in found.caption
    assert found.focus in found.rows
    least = choose(scenes, 4, METHODS, least=True)
    assert (least.scene, least.time_s) == ("plain", 0.0)
    assert "smallest, +0.000 m" in least.caption


def test_few_people_do_not_count_where_more_are_somewhere():
    scenes = {
        "few": planned(wall_scene("few"), walkers=2, planted_s=0.3),
        "many": planned(wall_scene("many"), walkers=4),
    }
    assert choose(scenes, 3, METHODS).scene == "many"
    assert choose(scenes, 99, METHODS).scene == "many"
    assert choose(scenes, 2, METHODS).scene == "few"


def test_without_a_model_there_is_nothing_to_show():
    windows = planned(wall_scene())
    del windows.predictions["lstm"]
    with pytest.raises(ValueRuleError, match="lstm must be among them"):
        choose({"hall": windows}, 1, METHODS)


@pytest.mark.parametrize("heading_rad", [0.0, 1.0, np.pi / 2, -2.5])
@pytest.mark.parametrize(("place", "row", "column"), [((2, 0), 10, 30), ((0, 2), 30, 10), ((-2, 0), 50, 30)])
def test_an_obstacle_ahead_is_drawn_above_and_one_to_the_left_is_drawn_left(heading_rad, place, row, column):
    agent = np.array([5.0, 5.0])
    occupied = np.zeros((100, 100), dtype=bool)
    x, y = np.floor((rotate(np.array(place), heading_rad) + agent) * 10 + 1e-9).astype(int)
    occupied[x - 1 : x + 2, y - 1 : y + 2] = True
    place = OccupancyMap(occupied, np.zeros(2), 0.1)
    crop = occupancy_crops(place, agent[None], np.array([heading_rad]), 60, 0.1)
    windows = windows_with(agent[None], np.zeros((1, 0, 2)), {}, packed_grid=crop)
    drawn = np.argwhere(grid_image(windows.grid(0))).mean(axis=0) + 0.5
    np.testing.assert_allclose(drawn, (row, column), atol=1.5)


def test_modes_of_the_person_in_focus_are_lines_as_wide_as_they_are_likely():
    paths = np.array([[[[1.0, 0.0]] * STEPS, [[0.0, 1.0]] * STEPS]] * 2)
    two = Predictions(paths[:, 0], paths, np.array([[0.7, 0.3]] * 2), 0.3)
    windows = windows_with(np.zeros((2, 2)), paths[:, 0], {"lstm": paths[:, 0]})
    windows = replace(windows, predictions={"lstm": two})
    axes = Figure().add_subplot()
    instant, shown = Instant.of("hall", windows, 0), [METHODS["lstm"]]
    draw_situation(axes, wall_scene(), windows, instant, shown, lambda points: points)
    modes = [line for line in axes.lines if line.get_alpha()]
    assert [line.get_xydata()[-1].tolist() for line in modes] == [[1.0, 0.0], [0.0, 1.0]]
    assert modes[0].get_linewidth() ** 2 / modes[1].get_linewidth() ** 2 == pytest.approx(0.7 / 0.3)


def gaussians(apart_m, weight=(0.6, 0.4)):
    """Two round modes of 1 m spread, one step ahead of one person."""
    path = np.array([[[[0.0, 0.0]], [[apart_m, 0.0]]]])
    covariance = np.tile(np.eye(2), (1, 2, 1, 1, 1))
    return Predictions(path[:, 0], path, np.array([weight]), 0.3, covariance)


def test_the_region_of_equal_modes_is_that_of_one():
    outline = np.concatenate(region_outlines(gaussians(0.0), 0, 0, 0.9))
    np.testing.assert_allclose(np.linalg.norm(outline, axis=-1), np.sqrt(radius2(0.9)), rtol=0.02)


def test_a_region_has_a_part_around_every_likely_mode():
    assert len(region_outlines(gaussians(8.0), 0, 0, 0.9)) == 2
    assert len(region_outlines(gaussians(8.0, (0.95, 0.05)), 0, 0, 0.9)) == 1


def test_the_edge_of_a_region_is_where_its_share_is_inside():
    outline = np.concatenate(region_outlines(gaussians(2.5), 0, 0, 0.5))[::7]
    inside = [share_inside(gaussians(2.5), point[None, None])[0, 0] for point in outline]
    np.testing.assert_allclose(inside, 0.5, atol=0.03)


@pytest.mark.parametrize(("cell", "direction"), [(0, (0, 1)), (18, (-1, 0)), (36, (0, -1)), (54, (1, 0))])
def test_a_person_ahead_is_drawn_above_and_one_to_the_left_is_drawn_left(cell, direction):
    distance_m = np.full(72, 6.0)
    distance_m[cell] = 3.0
    axes = Figure().add_subplot(projection="polar")
    draw_angular_grid(axes, distance_m, 6.0)
    edges = angular_cell_edges(72)
    arcs = [patch for patch in axes.patches if patch.get_y() > 0]
    assert len(arcs) == 1
    assert arcs[0].get_x() == pytest.approx(edges[cell])
    tip, centre = axes.transData.transform([(edges[cell], 3.0), (0.0, 0.0)])
    np.testing.assert_allclose((tip - centre) / np.linalg.norm(tip - centre), direction, atol=1e-6)


@pytest.mark.parametrize("turns", range(4))
def test_obstacles_and_people_turn_together(turns):
    occupied = np.zeros((7, 4), dtype=bool)
    occupied[5, 1] = occupied[0, 3] = True
    occupancy = OccupancyMap(occupied, np.array([2.0, -3.0]), 0.5)
    image, (left, right, bottom, top) = obstacle_image(occupancy, turns)
    centres = turn_points(occupancy.center_of(np.argwhere(occupied)), turns)
    columns, rows = np.floor((centres - [left, bottom]) / 0.5).astype(int).T
    assert image[rows, columns].all()
    assert image.sum() == 2
    assert image.shape == (round((top - bottom) / 0.5), round((right - left) / 0.5))


@pytest.mark.parametrize("turns", range(4))
def test_the_plan_lies_like_the_picture(turns):
    """A step to the right in the camera's picture is a step to the right in the plan."""
    inverse = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])[[-turns % 4, (1 - turns) % 4]]
    right_down = np.array([[0.0, 0.02], [-0.02, 0.0]])  # world from (row, column), unturned
    matrix = np.eye(3)
    matrix[:2, :2] = inverse.T @ right_down
    camera = Camera(Homography(matrix), np.zeros((480, 640, 3), np.uint8))
    step = camera.homography.to_world(np.array([[0.0, 0.0], [0.0, 50.0]]))
    found = turn_points(np.diff(step, axis=0)[0], quarter_turns_of(camera))
    np.testing.assert_allclose(found, (1.0, 0.0), atol=1e-9)


def curve_tables():
    steps = {"epoch": [0, 1], "step": [5, 10]}
    curve = pd.DataFrame(steps | {"train_loss": [1.0, 0.5], "validation_ade_m": [0.5, 0.4]})
    losses = {"train_loss": [3.0], "validation_loss": [4.0], "validation_iou": [0.2]}
    other = pd.DataFrame({"epoch": [0]} | losses)
    return {"autoencoder": other, "main_lstm": curve, "main_lstm_nogrid": curve, "finetune_eth_lstm": curve}


def test_curves_are_sorted_into_stages_and_models():
    found = {stage: list(curves) for stage, curves in by_stage(curve_tables(), METHODS).items()}
    assert found == {"autoencoder": [""], "main": ["lstm_nogrid", "lstm"], "finetune eth": ["lstm"]}
    axes = training_figure(curve_tables(), METHODS).axes
    assert [(own.get_title("left"), own.get_ylabel()) for own in axes] == [
        ("autoencoder", "validation IoU"),
        ("main", "validation ADE [m]"),
        ("finetune eth", "validation ADE [m]"),
    ]
    assert [line.get_label() for line in axes[1].lines] == ["LSTM-noGrid, 0.400", "LSTM, 0.400"]
    assert axes[2].lines[0].get_xydata().tolist() == [[5.0, 0.5], [10.0, 0.4]]


@pytest.mark.parametrize("stages", [1, 3, 8])
def test_no_training_curve_runs_behind_the_legend(stages):
    """Neither where it falls nor where it rises, whatever number of networks has one."""
    names = [f"{stage}_{row.key}" for stage in "abcdefgh"[:stages] for row in METHODS if row.learned]
    rising = {"epoch": [0, 1, 2], "step": [0, 5, 10], "validation_ade_m": [0.4, 0.45, 0.5]}
    falling = rising | {"validation_ade_m": [0.5, 0.45, 0.4]}
    tables = {name: pd.DataFrame((rising, falling)[k % 2]) for k, name in enumerate(names)}
    figure = training_figure(tables, METHODS)
    figure.canvas.draw()
    for axes in figure.axes:
        legend = axes.get_legend().get_window_extent()
        tops = [axes.transData.transform(line.get_xydata())[:, 1].max() for line in axes.lines]
        assert max(tops) < legend.y0


def galleries():
    scene = wall_scene()
    simulated = result_of(metrics_of(MEETING))
    real = result_of(metrics_of(MEETING | {"ca": 9.0}), "hall", ["real/home"])
    windows = {"hall": planned(scene, planted_s=0.9)}
    matrix = np.array([[0.0, 0.03, 0.0], [-0.03, 0.0, 20.0], [0.0, 0.0, 1.0]])
    picture = np.random.default_rng(7).integers(0, 256, (600, 600, 3), dtype=np.uint8)
    torch.manual_seed(0)
    network = GridAutoencoder(60, 8)
    seen = wall_scene(camera=Camera(Homography(matrix), picture))
    sets, curves = {"sim_test": [scene], "main": [scene] * 3}, curve_tables()
    sections = draw_gallery(
        Evaluated("sim", "simulated", [simulated], sets, windows, curves, network), METHODS
    )
    sections += draw_gallery(
        Evaluated("real", "real", [real], {"hall": [seen]}, windows, {}, network), METHODS
    )
    return [picture for section in sections for picture in section.pictures]


def test_all_pictures_come_out_the_same_twice_and_small():
    first, second = galleries(), galleries()
    assert len(first) == 12
    for one, two in zip(first, second, strict=True):
        file = png_bytes(one.figure)
        assert file == png_bytes(two.figure), one.name
        assert b"Software" not in file
        # the layout's last digits depend on addresses in memory, and lines would move with them
        bounds = np.array([axes.get_position(original=True).bounds for axes in one.figure.axes])
        np.testing.assert_allclose(bounds, np.round(bounds, 6), rtol=0, atol=1e-12)
        if "camera" not in one.name:  # its background is noise here, the worst case for a PNG
            assert len(file) < 300_000, one.name
        assert min(Image.open(io.BytesIO(file)).size) > 200
    packed = avif_bytes(first[0].figure, 10)
    assert packed == avif_bytes(second[0].figure, 10)
    assert Image.open(io.BytesIO(packed)).format == "AVIF"
    assert len(packed) < len(png_bytes(first[0].figure))


@pytest.mark.parametrize("lack", ["lstm", "motion"])
def test_a_place_without_the_main_method_or_without_motion_has_no_instants(lack):
    scene, windows = wall_scene(), planned(wall_scene())
    if lack == "lstm":
        del windows.predictions["lstm"]
    else:
        windows = dataclasses.replace(windows, velocity=0.0 * windows.velocity)
    figures = {key: errors for key, errors in metrics_of(MEETING).items() if key in windows.predictions}
    evaluated = Evaluated(
        "sim", "simulated", [result_of(figures)], {"sim_test": [scene]}, {"hall": windows}, {}, None
    )
    sections = {section.title: section for section in draw_gallery(evaluated, METHODS)}
    assert "Instants, chosen by rule" not in sections
    assert next(iter(sections)) == "Error over the horizon"


def test_crops_are_chosen_at_even_ranks_of_occupied_share():
    shares = np.random.default_rng(0).permutation(101) + 71  # 72 cells are a fiftieth
    packed = np.packbits(np.arange(3600) < shares[:, None], axis=1, bitorder="little")
    scenes = {"hall": windows_with(np.zeros((101, 2)), np.zeros((101, 0, 2)), {}, packed_grid=packed)}
    assert choose_evenly(scenes, 4).sum(axis=(1, 2)).tolist() == [72, 105, 138, 171]
    assert len(choose_evenly(scenes, 999)) == 100
    assert len(choose_evenly({}, 4)) == 0


def test_each_crop_is_reconstructed_by_itself():
    network = GridAutoencoder(60, 8)
    crops = np.random.default_rng(0).random((3, 60, 60)) < 0.2
    (images, agreement), (alone, _) = reconstruct(network, crops), reconstruct(network, crops[2:])
    np.testing.assert_array_equal(images[2:], alone)
    occupied = images[0] > 0.5
    assert agreement[0] == pytest.approx((occupied & crops[0]).sum() / (occupied | crops[0]).sum())


def test_a_sheet_shows_every_room_apart_from_the_others_with_its_own_tracks():
    axes = contact_sheet([wall_scene(name) for name in ("a", "b", "c")], 6.0, columns=2).axes[0]
    corners = [np.reshape(image.get_extent(), (2, 2)).T for image in axes.images]
    assert [tuple(low) for low, _ in corners] == [(0.0, 21.0), (21.0, 21.0), (0.0, 0.0)]
    for (low, high), tracks in zip(corners, axes.collections, strict=True):
        assert len(tracks.get_segments()) == 6
        points = np.concatenate(tracks.get_segments())
        np.testing.assert_allclose([points.min(axis=0) - low, high - points.max(axis=0)], [[2, 3], [11.5, 7]])


def test_scenes_of_one_name_in_two_test_sets_are_told_apart():
    rooms = [wall_scene(name) for name in ("office", "plaza")]
    sets = {"sensed": rooms[:1], "main": rooms, "sim_test": rooms}
    assert scene_names(["sim_test", "sensed", "gone", "sim_test"], sets) == {
        ("sim_test", "office"): "office",
        ("sim_test", "plaza"): "plaza",
        ("sensed", "office"): "sensed_office",
    }


def test_forecasts_of_an_unknown_scene_are_refused():
    windows = {"attic": planned(wall_scene("attic"))}
    results = [result_of(metrics_of(MEETING))]
    with pytest.raises(ValueRuleError, match="attic"):
        draw_gallery(
            Evaluated("sim", "simulated", results, {"sim_test": [wall_scene()]}, windows, {}, None), METHODS
        )


def test_a_method_far_beyond_the_others_does_not_set_the_scale():
    figure = horizon_figure(result_of(metrics_of(MEETING | {"ca": 9.0})), METHODS)
    assert figure.axes[0].get_ylim()[1] < 1.3 * 1.9 * 0.7 * 1.5
    legend = figure.legends[0]
    assert "beyond" in legend.get_texts()[1].get_text()


def test_the_horizon_table_has_a_row_per_step_and_sorts_as_text():
    metrics = metrics_of(MEETING)
    table = horizon_table(result_of(metrics), METHODS)
    assert list(table["horizon_s"]) == sorted(table["horizon_s"])
    assert table["lstm"].tolist() == metrics["lstm"]["per_step_m"]
    assert table["horizon_s"].iloc[-1] == f"{0.3 * len(table):.1f}"
