"""Real places side by side: figures of each study, forecasts at walls chosen by rule, gains over walls."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.report.canvas import png_bytes
from pedpred.report.charts import box_plot
from pedpred.report.gallery import Evaluated
from pedpred.report.gather import study_page
from pedpred.report.measures import results_of
from pedpred.report.places import places_section, places_table, ratios_table, wins
from pedpred.report.walls import RANKS, gains, gains_figure, wall_figure, wall_windows
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from tests.forecasts import METHODS, PAPER, windows_with
from tests.test_report import MEETING, metrics_of

STEPS = 5
AHEAD = np.arange(1, STEPS + 1)[:, None] * [1.0, 0.0]
WHERE = (["real/hall"], ["real/yard"])


def results(study, changes, missing=()):
    """Figures at two places; `changes`: place -> the LSTM's ADE there, m."""
    metrics = {place: metrics_of(MEETING | {"lstm": ade}) for place, ade in changes.items()}
    trained = {"train": ["real/barn"]} if study == "real" else {}
    return results_of(metrics, [{"test": sets} | trained for sets in WHERE], study, 0.3, missing)


def wall_scene(times, people):
    """A wall at x > 6 m, and people who were there at all times."""
    occupied = np.zeros((100, 100), bool)
    occupied[60:] = True
    time_s, track = np.meshgrid(times, people, indexing="ij")
    position = np.stack([time_s.ravel(), track.ravel() * 0.5], axis=-1)
    trajectories = Trajectories(time_s.ravel(), track.ravel(), position)
    return Scene("hall", trajectories, OccupancyMap(occupied, np.zeros(2), 0.1), 1.0)


def at_walls(people=9, far=2):
    """Everybody is seen at x = 1, 2, 3 and walks 1 m/step; the LSTM is off by 0.1 m per person's number.

    Of 5 steps ahead 0, 1 and 2 end in the wall; the last `far` people stand away and meet none.
    """
    track, x = np.repeat(np.arange(people), 3), np.tile([1.0, 2.0, 3.0], people)
    away = track >= people - far
    position = np.stack([np.where(away, 0.5, x), 0.5 + track], axis=-1)
    straight = position[:, None] + AHEAD * np.where(away, 0.2, 1.0)[:, None, None]
    truth = np.minimum(straight, [5.5, np.inf])
    lstm = truth + 0.1 * track[:, None, None] * [0.0, 1.0]
    return windows_with(position, truth, {"cv": straight, "lstm": lstm}, track_id=track, time_s=x)


def test_of_each_person_at_a_wall_the_worst_window_is_a_candidate_whatever_the_network_does():
    windows, scene = at_walls(), wall_scene([1.0, 2.0, 3.0], range(9))
    rows = wall_windows(windows, scene, METHODS)
    assert windows.time_s[rows].tolist() == [3.0] * len(RANKS)
    assert windows.track_id[rows].tolist() == [round(6 * rank) for rank in RANKS]
    assert (np.diff(windows.ade_m("lstm")[rows]) > 0).all()


def test_nothing_is_shown_where_nobody_meets_a_wall():
    windows = at_walls(people=3, far=3)
    assert not len(wall_windows(windows, wall_scene([1.0], range(3)), METHODS))


def test_a_gain_is_relative_to_the_best_simple_method_in_the_place_or_in_each_room():
    (hall, _) = results("real", {"hall": 0.3, "yard": 0.3})
    (found,) = gains([hall], "here", METHODS, METHODS["lstm"])
    assert found.ratio == pytest.approx(0.3 / min(MEETING[key] for key in ("cv", "ca", "kalman_cv")))
    assert found.share == 0.0123
    rooms = {"set": metrics_of(MEETING), "set_a": metrics_of(MEETING), "set_b": metrics_of(MEETING)}
    pooled = results_of(rooms, [{"test": ["simulated/set"]}], "sim", 0.3)
    assert [gain.name for gain in gains(pooled, "there", METHODS, METHODS["lstm"])] == ["a", "b"]


def test_a_method_with_weights_has_a_column_per_study_and_every_error_its_interval():
    studies = {
        study: {result.name: result for result in results(study, {"hall": ade, "yard": 0.5})}
        for study, ade in (("transfer", 0.3), ("real", 0.4))
    }
    header, _, hall, yard = places_table(studies, "ade_m", METHODS).markdown("").splitlines()
    assert [title.strip() for title in header.split("|")[2:-1]] == [
        *("CV", "CA", "Kalman CV", "SF, true goal"),
        *("LSTM-noGrid, simulated", "LSTM-noGrid, tuned", "LSTM, simulated", "LSTM, tuned"),
    ]
    assert hall.endswith("| 0.300 (0.280 to 0.330) | 0.400 (0.380 to 0.430) |")
    assert yard.startswith("| yard | 0.700 (0.680 to 0.730) | 0.800")


def test_wins_and_ratios_are_to_the_best_simple_method_at_each_place():
    studies = {
        study: {result.name: result for result in results(study, changes)}
        for study, changes in (
            ("transfer", {"hall": 0.3, "yard": 0.72}),
            ("real", {"hall": 0.33, "yard": 0.5}),
        )
    }
    words = wins(studies, METHODS["lstm"], METHODS)
    assert "never saw, the LSTM beats the best of CV, CA and Kalman CV at 1 of 2 when trained in sim" in words
    assert words.endswith(
        "(0.50 to 1.20 times its ADE) and at 2 of 2 when fine-tuned on the other places "
        "(0.55 to 0.83 times its ADE)."
    )
    header, _, hall, yard = ratios_table(studies, METHODS).markdown("").splitlines()
    networks = [f"{name}, {how}" for name in ("LSTM", "LSTM-noGrid") for how in ("simulated", "tuned")]
    assert header.endswith(f"| best simple ADE [m] | {' | '.join(networks)} | Kalman CV |")
    assert hall == "| hall | 0.600 (0.580 to 0.630) | **0.50** | **0.55** | **0.83** | **0.83** | 1.00 |"
    assert yard == "| yard | 0.600 (0.580 to 0.630) | 1.20 | **0.83** | **0.83** | **0.83** | 1.00 |"


def test_the_section_shows_walls_and_names_a_missing_place():
    windows, scene = at_walls(), wall_scene([1.0, 2.0, 3.0], range(9))
    found = results("transfer", {"hall": 0.3}, missing=["real/yard"])
    found[0].figures["cv"]["obstacle_share"] = 0.1
    scenes, forecasts = {"hall": [scene]}, {"hall": windows}
    evaluated = Evaluated("transfer", "real", found, scenes, forecasts, {}, None, {"yard": "ask for it"})
    section = places_section([evaluated], METHODS)
    assert [picture.name for picture in section.pictures] == ["walls_hall", "walls"]
    text = section.markdown("places")
    assert "Not available, hence neither trained on nor tested: yard" in text
    assert "| yard | ask for it |" in text
    assert text.index("| hall |") < text.index("places/walls_hall.png") < text.index("places/walls.png")
    nothing = Evaluated("transfer", "real", [], {}, {}, {}, None, {"hall": "ask", "yard": "ask"})
    assert not list(places_section([nothing], METHODS).pictures)


def test_simulated_people_in_place_of_recordings_are_called_so_and_nothing_else():
    windows, scene = at_walls(), replace(wall_scene([1.0, 2.0, 3.0], range(9)), stand_in="drawn by hand")
    found = results_of({"hall": metrics_of(MEETING)}, [{"train": [], "test": ["real/hall"]}], "real", 0.3)
    evaluated = Evaluated("real", "real", found, {"hall": [scene]}, {"hall": windows}, {}, None)
    section = places_section([evaluated], METHODS)
    text = section.markdown("places")
    assert "In place of recordings: hall, drawn by hand. Its figures" in text.replace("**", "")
    assert "With simulated people in place of recordings, the LSTM beats" in text
    for words in ("Real places", "real places", "never saw", "fine-tuned"):
        assert words not in text
    page = study_page(evaluated, [], METHODS, PAPER)
    assert page.title == "Simulated people in place of recordings: no network was trained on them"
    assert page.markdown("real").count("drawn by hand") == 1


def test_networks_that_nothing_fine_tuned_are_not_called_fine_tuned():
    sets = [{"train": ["real/lost"], "test": ["real/hall"]}]
    (result,) = results_of({"hall": metrics_of(MEETING)}, sets, "real", 0.3, ["real/lost"])
    words = wins({"real": {"hall": result}}, METHODS["lstm"], METHODS)
    assert "when trained in simulation only" in words


def test_figures_of_walls_come_out_the_same_twice():
    windows, scene = at_walls(), wall_scene([1.0, 2.0, 3.0], range(9))
    rows = wall_windows(windows, scene, METHODS)
    assert len(wall_figure(scene, windows, rows, METHODS).axes) == len(RANKS)
    files = [png_bytes(wall_figure(scene, windows, rows, METHODS)) for _ in range(2)]
    assert files[0] == files[1]
    found = gains(results("real", {"hall": 0.3, "yard": 0.9}), "here", METHODS, METHODS["lstm"])
    (axes,) = gains_figure(found, METHODS).axes
    assert {name for text in axes.texts for name in text.get_text().split()} == {"hall", "yard"}


@pytest.mark.parametrize("left_out", [("cv",), ("kalman_cv",), ("cv", "kalman_cv")])
def test_places_are_compared_with_the_simple_methods_that_were_evaluated(left_out):
    found = results("transfer", {"hall": 0.3, "yard": 0.4})
    for result in found:
        for method in left_out:
            result.figures.pop(method, None)
    study = Evaluated("transfer", "real", found, {}, {}, {}, None)
    left = any(method.key in found[0].figures for method in METHODS.simple)
    assert ("hall" in places_section([study], METHODS).blocks[1].markdown("")) == left


@pytest.mark.parametrize("exact", [{"kalman_cv"}, set(MEETING)])
def test_a_page_is_made_where_forecasts_are_exact(exact):
    found = results("transfer", {"hall": 0.3, "yard": 0.4})
    for method in exact:
        for figures in (result.figures[method] for result in found):
            figures |= {key: 0.0 for key, value in figures.items() if isinstance(value, float)}
            figures |= {key: [0.0] * len(value) for key, value in figures.items() if isinstance(value, list)}
    study = Evaluated("transfer", "real", found, {}, {}, {}, None)
    page = study_page(study, [], METHODS, PAPER).markdown("")
    assert ("no better" if "lstm" in exact else "worse") in page
    for result in found:
        box_plot(result.figures, "", result.dt_s, METHODS)
