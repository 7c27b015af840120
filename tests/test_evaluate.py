"""`pedpred evaluate`: conditions, forecasts of other programs, pools and comparisons."""

import csv
import dataclasses
import json
import re
import shutil

import numpy as np
import pandas as pd
import pytest
import yaml

from pedpred.command import main
from pedpred.command.evaluation import isolating_shifts, shift_times
from pedpred.command.forecast_tables import COLUMNS
from pedpred.command.prediction import predictor_for
from pedpred.command.recordings import open_scene
from pedpred.evaluation import EvaluationSettings
from pedpred.online.assessment import assess
from pedpred.online.replay import replay_scene
from pedpred.scenes import OccupancyMap
from pedpred.storage.scenes import read_scene, write_scene
from tests.simulated import read
from tests.worlds import come_again, walled_scene

FAST = ("--samples", "20")


@pytest.fixture
def hall(tmp_path):
    """A scene folder with walls and two people."""
    world = walled_scene(np.random.default_rng(2), 0.4, detections=35, tracks=2)
    write_scene(dataclasses.replace(world, name="hall"), tmp_path / "hall")
    return tmp_path / "hall"


@pytest.fixture
def walk(tmp_path):
    """One person who walks straight at 1 m/s."""
    return table_of_people(tmp_path / "walk.csv", [(0.4 * k, 1, 0.4 * k, 0.0) for k in range(30)])


def table_of_people(path, rows):
    pd.DataFrame(rows, columns=["time", "id", "x", "y"]).to_csv(path, index=False, float_format="%.6f")
    return path


@pytest.fixture
def measured(tmp_path, mixture):
    """The figures that a command writes, with a network without memory."""

    def run(*arguments, model=mixture[0]):
        out = tmp_path / "figures.json"
        main(["evaluate", *map(str, arguments), *FAST, "--model", str(model), "--json", str(out)])
        return json.loads(out.read_text(), parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))

    return run


# Scenes


def test_scenes_are_pooled(hall, tmp_path, measured, model):
    for name in ("walled", "other"):
        write_scene(dataclasses.replace(read_scene(hall), name=name), tmp_path / name)
    figures = measured(tmp_path / "walled", tmp_path / "other", model=model[0])
    assert list(figures) == ["walled", "other", "all"]
    one, both = figures["walled"]["network"], figures["all"]["network"]
    assert both["ade_m"] == pytest.approx(one["ade_m"])
    assert (both["windows"], both["tracks"]) == (2 * one["windows"], 2 * one["tracks"])


def test_two_scenes_of_one_name_are_both_measured(hall, tmp_path, measured):
    days = [tmp_path / day / "hall" for day in ("monday", "tuesday")]
    for day in days:
        shutil.copytree(hall, day)
    assert list(measured(*days)) == [*(f"hall ({day})" for day in days), "all"]
    with pytest.raises(SystemExit):
        measured(*days, days[0])


def test_a_scene_without_windows_is_refused(tmp_path, measured):
    path = table_of_people(tmp_path / "walk.csv", [(t, 1, 0.1 * t, 0.0) for t in (0, 0.4)])
    with pytest.raises(SystemExit):
        measured(path)


def test_people_who_move_and_who_stand_are_measured_apart(tmp_path, measured):
    time_s, rng = np.arange(20) * 0.4, np.random.default_rng(0)
    walking = np.stack([time_s, np.zeros(20)], axis=-1) + rng.normal(0.0, 0.02, (20, 2))
    standing = rng.normal(5.0, 0.02, (2, 20, 2))  # twice as many
    paths = enumerate((walking, *standing))
    rows = [(t, k, *p) for k, path in paths for t, p in zip(time_s, path, strict=True)]
    found = measured(table_of_people(tmp_path / "square.csv", rows))["square"]
    for own in found.values():
        parts = own["moving_ade_m"] + 2 * own["standing_ade_m"]
        assert own["ade_m"] == pytest.approx(parts / 3, abs=1e-4)
    assert found["kalman_cv"]["moving_ade_m"] != found["kalman_cv"]["standing_ade_m"]


def test_people_who_share_no_instant_do_not_collide(tmp_path, measured):
    """Two people on one line, detected at the same instants and each at instants of its own."""
    for name, late_s in (("late", 0.1), ("line", 0.0)):
        rows = [(0.4 * k + who * late_s, who, 0.4 * k, 0.1 * who) for k in range(30) for who in (0, 1)]
        table_of_people(tmp_path / f"{name}.csv", rows)
    found = measured(tmp_path / "late.csv", tmp_path / "line.csv")
    assert "collision_share" not in found["late"]["cv"]
    assert (found["line"]["cv"]["collision_share"], found["all"]["cv"]["collision_share"]) == (1.0, 1.0)


# Conditions


def test_a_file_of_a_tracker_is_about_the_network_alone(hall, tmp_path, measured):
    own = {"kind": "kalman", "acceleration_noise": 30.0, "position_noise_m": 0.001}
    (tmp_path / "sure.yaml").write_text(yaml.safe_dump(own))
    usual, sure = measured(hall)["hall"], measured(hall, "--tracker", tmp_path / "sure.yaml")["hall"]
    for method in ("cv", "kalman_cv"):
        assert sure[method]["ade_m"] == usual[method]["ade_m"]
    assert sure["network"]["ade_m"] != usual["network"]["ade_m"]


def test_the_network_alone_can_be_measured(hall, tmp_path, measured):
    again = dataclasses.replace(come_again(read_scene(hall), 60.0), name="again")
    write_scene(again, tmp_path / "again")
    usual = measured(tmp_path / "again")["again"]["network"]
    alone = measured(tmp_path / "again", "--no-trust")["again"]["network"]
    once = measured(hall, "--no-trust")["hall"]["network"]
    assert alone["ade_m"] == pytest.approx(once["ade_m"], abs=1e-6)
    assert usual["ade_m"] != pytest.approx(once["ade_m"], abs=1e-3)


def test_without_map_it_is_neither_seen_nor_measured(hall, tmp_path, measured):
    scene = read_scene(hall)
    free = OccupancyMap.free_around(scene.trajectories.position)
    write_scene(dataclasses.replace(scene, occupancy=free), tmp_path / "free")
    unseen, absent = measured(hall, "--no-map")["hall"], measured(tmp_path / "free")["hall"]
    assert unseen["network"]["ade_m"] == absent["network"]["ade_m"]
    assert "obstacle_share" not in unseen["network"]


def test_thresholds_are_published_ones_and_reach_their_metrics(hall, measured):
    published, usual = read("evaluation/paper"), EvaluationSettings()
    assert (usual.moving_mps, usual.collision_m) == (published["moving_mps"], published["collision_m"])
    own = measured(hall, "--moving-mps", 999, "--collision-m", 999)["hall"]["cv"]
    assert "moving_ade_m" not in own
    assert own["collision_share"] > 0.9  # of two people


def test_alone_means_each_person_by_itself(hall, mixture):
    scene, settings = read_scene(hall), EvaluationSettings(bootstrap=1)
    isolated = shift_times(scene.trajectories, isolating_shifts(scene.trajectories))
    robot = predictor_for(scene, mixture[0], learns=False)  # as `--alone` has it
    together = assess(dataclasses.replace(scene, trajectories=isolated), robot, settings)["network"]
    people = scene.trajectories.track_id
    for track in np.unique(people):
        one = dataclasses.replace(scene, trajectories=scene.trajectories.select(people == track))
        own = assess(one, predictor_for(scene, mixture[0], learns=False), settings)["network"]
        np.testing.assert_allclose(together.error_m[together.track == track], own.error_m, atol=1e-6)


@pytest.mark.parametrize(("tracks", "warned"), [(1, False), (2, True), (10, False)])
def test_intervals_over_few_tracks_are_warned_about(tracks, warned, tmp_path, measured, caplog, capsys):
    """Of two tracks, a bootstrap interval reaches from one mean to the other; one track has none."""
    rows = [(0.4 * k, who, 0.4 * k, 3.0 * who) for k in range(14) for who in range(tracks)]
    measured(table_of_people(tmp_path / "few.csv", rows))
    assert (f"{tracks} tracks" in caplog.text) is warned
    assert bool(re.search(r"\d - \d", capsys.readouterr().out)) is (tracks > 1)


# Forecasts of other programs


def straight_lines(rows=12, step_s=0.3, track=1, made_s=2.0, y=0.0, scale=1.0):
    """A table that forecasts a straight walk at 1 m/s."""
    lines = [f"{track},{made_s},0,1,{n},{scale * (2.0 + step_s * n)},{y}" for n in range(1, rows + 1)]
    return "\n".join([",".join(COLUMNS), *lines]) + "\n"


@pytest.fixture
def theirs(tmp_path):
    """Writes a file of forecasts; the options that name it."""

    def write(text, name="theirs.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
        return "--forecasts", tmp_path / name

    return write


@pytest.mark.parametrize("every", [1, 5])
def test_own_forecasts_in_a_table_are_measured_as_own(every, hall, tmp_path, mixture, measured):
    """All methods are compared in the windows that the table has."""
    scene = open_scene(hall)
    with (tmp_path / "theirs.csv").open("w") as stream:
        rows = csv.writer(stream)
        rows.writerow(COLUMNS)
        for forecast in list(replay_scene(scene, predictor_for(scene, mixture[0])))[::every]:
            for n, track in enumerate(forecast.track_id):
                paths, weights = forecast.predictions.path[n], forecast.predictions.weight[n]
                for mode, (steps, weight) in enumerate(zip(paths, weights, strict=True)):
                    for step, (x, y) in enumerate(steps):
                        rows.writerow([track, forecast.time_s, mode, weight, step + 1, x, y])
    figures = measured(hall, "--forecasts", tmp_path / "theirs.csv")["hall"]
    for metric in ("min_ade_m_k3", "min_fde_m_k6", "most_likely_ade_m"):
        assert figures["theirs"][metric] == pytest.approx(figures["network"][metric], abs=2e-3)
    windows, all_windows = figures["cv"]["windows"], measured(hall)["hall"]["cv"]["windows"]
    assert figures["theirs"]["windows"] == windows
    assert windows == all_windows if every == 1 else 0 < windows < all_windows


@pytest.mark.parametrize("step_s", [0.3, 0.4])
def test_steps_of_another_length_are_interpolated(walk, step_s, measured, theirs):
    found = measured(walk, *theirs(straight_lines(12, step_s)), "--step-s", step_s)["walk"]["theirs"]
    assert found["ade_m"] == pytest.approx(0.0, abs=1e-5)
    assert found["windows"] == 1


@pytest.mark.parametrize(("rows", "scale", "warned"), [(10, 1.0, False), (12, 1.0, True), (10, 100.0, True)])
def test_steps_and_units_of_others_are_warned_about(rows, scale, warned, walk, measured, theirs, caplog):
    """Twelve steps are mostly 0.4 s apart, as in the literature, and windows have ten of 0.3 s."""
    measured(walk, *theirs(straight_lines(rows, scale=scale)))
    warnings = [one.getMessage() for one in caplog.records if one.levelname == "WARNING"]
    assert any("theirs.csv" in text for text in warnings) is warned


def trajnet(predictions):
    lines = [{"scene": {"id": 7, "p": 1, "s": 0, "e": 200, "fps": 2.5}}]
    lines += [{"track": {"f": 10 * k, "p": 1, "x": 0.4 * k, "y": 0.0}} for k in range(6)]
    for number, side in enumerate(predictions):
        for k in range(6, 18):
            own = {"f": 10 * k, "p": 1, "x": 0.4 * k, "y": side, "prediction_number": number, "scene_id": 7}
            lines.append({"track": own})
    return "\n".join(map(json.dumps, lines))


def test_predictions_of_trajnet_are_measured(walk, measured, theirs):
    found = measured(walk, *theirs(trajnet([0.5, 0.0]), "them.ndjson"))["walk"]["them"]
    assert found["windows"] == 1
    assert found["min_ade_m_k3"] == pytest.approx(0.0, abs=1e-5)
    assert found["ade_m"] > 0.3


@pytest.mark.parametrize(
    "text",
    [
        "",
        straight_lines(5),
        straight_lines(track=8),
        straight_lines(made_s=2.2),
        trajnet([0.0]),
    ],
    ids=["empty", "too short", "another track", "another time", "of another kind"],
)
def test_forecasts_of_other_windows_are_refused(text, walk, measured, theirs):
    with pytest.raises(SystemExit, match=r"theirs\.csv"):
        measured(walk, *theirs(text))


def test_a_file_named_like_a_method_gets_a_name_of_its_own(walk, measured, theirs):
    own, mine = (theirs(straight_lines(y=1.0), f"{name}.csv") for name in ("network", "mine"))
    found, other = (measured(walk, *one)["walk"] for one in (own, mine))
    name = f"network ({own[1]})"
    assert list(found) == ["cv", "ca", "kalman_cv", "network", name]
    assert found == {name if key == "mine" else key: value for key, value in other.items()}


def test_forecasts_of_the_command_have_the_names_of_the_file(tmp_path, measured):
    """Also names that are numbers of other tracks; forecasts that use the numbers belong to them, too."""
    rows = [(0.4 * k, who, 0.4 * k, 1.5 * len(who)) for k in range(24) for who in ("Bo", "0")]
    walk = table_of_people(tmp_path / "walk.csv", rows)
    for kind in ("csv", "parquet"):
        main(["predict", str(walk), "-o", str(tmp_path / f"theirs.{kind}")])
        assert measured(walk, "--forecasts", tmp_path / f"theirs.{kind}")["walk"]["theirs"]["ade_m"] < 0.2
    others = pd.read_parquet(tmp_path / "theirs.parquet").replace({"track": {"Bo": "Cy", "0": "Di"}})
    others.to_csv(tmp_path / "others.csv", index=False)
    with pytest.raises(SystemExit, match=r"others\.csv"):
        measured(walk, "--forecasts", tmp_path / "others.csv")


AROUND, SEEN = range(4), 16
"""People on circles, and how often each is detected."""


@pytest.fixture(scope="module")
def circles(tmp_path_factory):
    """People on circles, as a table, a folder and a bag, and forecasts that are right."""
    folder, rng = tmp_path_factory.mktemp("circles"), np.random.default_rng(0)
    seen, ahead = [], []
    for who in AROUND:
        centre, radius, turn = rng.uniform(-8, 8, 2), rng.uniform(2, 4), rng.uniform(0.2, 0.5)

        def at(time_s, centre=centre, radius=radius, turn=turn):
            return centre + radius * np.array([np.cos(turn * time_s), np.sin(turn * time_s)])

        for now in 0.4 * np.arange(5 * who, 5 * who + SEEN):
            seen.append((now, who, *at(now)))
            ahead += [(who, now, 0, 1, step, *at(now + 0.3 * step)) for step in range(1, 11)]
    table_of_people(folder / "walk.csv", seen)
    pd.DataFrame(ahead, columns=list(COLUMNS)).to_csv(folder / "perfect.csv", index=False)
    for name in ("walk.mcap", "walk"):
        main(["convert", str(folder / "walk.csv"), "-o", str(folder / name)])
    return folder


ALONE, FREE, MOVED = ("--alone",), ("--no-map",), ("--transform", "30", "-4", "2.1")


@pytest.mark.parametrize(
    ("recording", "options"),
    [
        ("walk.csv", ()),
        *((name, (*ALONE, *FREE, *MOVED)) for name in ("walk.csv", "walk.mcap", "walk")),
    ],
)
def test_forecasts_follow_their_people_through_every_option(options, recording, circles, measured):
    """Those that are right stay right, whatever is done to the scene, in as many windows."""
    (figures,) = measured(circles / recording, "--forecasts", circles / "perfect.csv", *options).values()
    assert figures["perfect"]["ade_m"] < 0.01
    assert figures["perfect"]["windows"] == len(AROUND) * (SEEN - 3 - 8)
    assert figures["cv"]["ade_m"] > 0.1
