"""`pedpred evaluate`: conditions, other people's forecasts, pools and the verdict."""

import csv
import dataclasses
import json
import shutil

import numpy as np
import pytest
import yaml

from pedpred.command import main
from pedpred.command.evaluation import Apart
from pedpred.command.forecast_tables import COLUMNS
from pedpred.command.prediction import predictor_for
from pedpred.command.recordings import open_scene
from pedpred.errors import ValueRuleError
from pedpred.evaluation import EvaluationSettings
from pedpred.online.assessment import assess
from pedpred.online.replay import replay_scene
from pedpred.scenes import OccupancyMap
from pedpred.storage.scenes import read_scene, write_scene
from tests.worlds import come_again, walled_scene

FAST = ("--samples", "20")


@pytest.fixture
def hall(tmp_path):
    """A scene folder with walls and two people."""
    world = walled_scene(np.random.default_rng(2), 0.4, detections=35, tracks=2)
    write_scene(dataclasses.replace(world, name="hall"), tmp_path / "hall")
    return tmp_path / "hall"


def measured(*arguments, out):
    """The figures that a command writes."""
    main(["evaluate", *map(str, arguments), *FAST, "--json", str(out)])
    return json.loads(out.read_text(), parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


@pytest.mark.parametrize(("names", "pool"), [(("walled", "other"), "all"), (("all", "other"), "all scenes")])
def test_several_scenes_are_pooled_under_a_name_that_none_has(names, pool, hall, tmp_path, model):
    for name in names:
        write_scene(dataclasses.replace(read_scene(hall), name=name), tmp_path / name)
    figures = measured(*(tmp_path / n for n in names), "--model", model[0], out=tmp_path / "e.json")
    assert list(figures) == [*names, pool]
    one, both = figures[names[0]]["network"], figures[pool]["network"]
    assert both["ade_m"] == pytest.approx(one["ade_m"])
    assert (both["windows"], both["tracks"]) == (2 * one["windows"], 2 * one["tracks"])


def test_two_scenes_of_one_name_are_both_measured(hall, tmp_path, model):
    days = [tmp_path / day / "hall" for day in ("monday", "tuesday")]
    for day in days:
        shutil.copytree(hall, day)
    figures = measured(*days, "--model", model[0], out=tmp_path / "e.json")
    assert list(figures) == [*(f"hall ({day})" for day in days), "all"]
    (tmp_path / "again").symlink_to(days[0])
    with pytest.raises(SystemExit, match="again', but it is given twice"):
        measured(*days, tmp_path / "again", "--model", model[0], out=tmp_path / "e.json")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("0,1,0,0\n0.4,1,0.4,0\n", "nobody in walk is detected 4 times and 3 s longer"),
        ("0,1,0,0\n400,1,0.4,0\n800,1,0.8,0\n", "looks like milliseconds"),
        ("0,1,0,0\n4,1,0.4,0\n8,1,0.8,0\n12,1,1,0\n16,1,1,0\n", r"lost for more than 2 s; .* 4 s apart"),
    ],
)
def test_a_scene_without_windows_says_the_true_cause(table, message, tmp_path, model):
    (tmp_path / "walk.csv").write_text(f"time,id,x,y\n{table}")
    with pytest.raises(SystemExit, match=message):
        main(["evaluate", str(tmp_path / "walk.csv"), "--model", str(model[0])])


def test_the_tracker_of_a_file_is_the_tracker_of_all_methods(hall, tmp_path, mixture):
    own = {"kind": "kalman", "acceleration_noise": 30.0, "position_noise_m": 0.001}
    (tmp_path / "sure.yaml").write_text(yaml.safe_dump(own))
    common = (hall, "--model", mixture[0])
    usual = measured(*common, out=tmp_path / "a.json")["hall"]
    sure = measured(*common, "--tracker", tmp_path / "sure.yaml", out=tmp_path / "b.json")["hall"]
    assert sure["cv"]["ade_m"] == usual["cv"]["ade_m"]
    for method in ("kalman_cv", "network"):
        assert sure[method]["ade_m"] != usual[method]["ade_m"]


def test_a_tracker_can_be_fitted_to_the_recording(hall, tmp_path, mixture, caplog):
    with caplog.at_level("INFO"):
        tuned = measured(hall, "--model", mixture[0], "--tracker", "tune", out=tmp_path / "t.json")["hall"]
    usual = measured(hall, "--model", mixture[0], out=tmp_path / "a.json")["hall"]
    assert "acceleration_noise" in caplog.text
    assert tuned["kalman_cv"]["ade_m"] < usual["kalman_cv"]["ade_m"]


def test_the_network_alone_can_be_measured(hall, tmp_path, mixture):
    scene = come_again(read_scene(hall), 60.0)
    write_scene(dataclasses.replace(scene, name="again"), tmp_path / "again")
    given = (tmp_path / "again", "--model", mixture[0])
    usual = measured(*given, out=tmp_path / "a.json")["again"]["network"]
    alone = measured(*given, "--no-trust", out=tmp_path / "b.json")["again"]["network"]
    once = measured(hall, "--model", mixture[0], out=tmp_path / "c.json")["hall"]["network"]
    assert alone["ade_m"] == pytest.approx(once["ade_m"], abs=1e-6)
    assert usual["ade_m"] != pytest.approx(once["ade_m"], abs=1e-3)


def test_without_map_nothing_of_it_is_seen_or_measured(hall, tmp_path, mixture):
    scene = read_scene(hall)
    free = OccupancyMap.free_around(scene.trajectories.position)
    write_scene(dataclasses.replace(scene, occupancy=free), tmp_path / "free")
    unseen = measured(hall, "--model", mixture[0], "--no-map", out=tmp_path / "a.json")["hall"]["network"]
    absent = measured(tmp_path / "free", "--model", mixture[0], out=tmp_path / "b.json")["hall"]["network"]
    assert unseen["ade_m"] == absent["ade_m"]
    assert "obstacle_share" not in unseen


def test_people_who_move_and_people_who_stand_are_measured_apart(tmp_path, model, capsys):
    time_s, rng = np.arange(20) * 0.4, np.random.default_rng(0)
    walking = np.stack([time_s, np.zeros(20)], axis=-1) + rng.normal(0.0, 0.02, (20, 2))
    standing = rng.normal(5.0, 0.02, (2, 20, 2))  # twice as many
    rows = [
        (t, k, *p) for k, path in enumerate((walking, *standing)) for t, p in zip(time_s, path, strict=True)
    ]
    (tmp_path / "square.csv").write_text(
        "time,id,x,y\n" + "".join(f"{t},{k},{x},{y}\n" for t, k, x, y in rows)
    )
    found = measured(tmp_path / "square.csv", "--model", model[0], out=tmp_path / "e.json")["square"]
    each = found["cv"]["windows"] // 3
    assert f"({each} of people who move, {2 * each} of people who stand)" in capsys.readouterr().out
    for own in found.values():
        parts = own["moving_ade_m"] + 2 * own["standing_ade_m"]
        assert own["ade_m"] == pytest.approx(parts / 3, abs=1e-4)
    kalman = found["kalman_cv"]
    assert kalman["moving_ade_m"] != kalman["standing_ade_m"]


def test_collisions_of_people_who_share_no_instant_are_not_measured(tmp_path, mixture):
    """Two people on one line, detected at the same instants and each at instants of its own."""
    for name, late_s in (("late", 0.1), ("line", 0.0)):
        rows = [
            f"{0.4 * k + who * late_s:.1f},{who},{0.4 * k:.1f},{0.1 * who}"
            for k in range(30)
            for who in (0, 1)
        ]
        (tmp_path / f"{name}.csv").write_text("\n".join(["time,id,x,y", *rows]) + "\n")
    given = (tmp_path / "late.csv", tmp_path / "line.csv", "--model", mixture[0])
    found = measured(*given, out=tmp_path / "e.json")
    assert "collision_share" not in found["late"]["cv"]
    assert (found["line"]["cv"]["collision_share"], found["all"]["cv"]["collision_share"]) == (1.0, 1.0)


def test_thresholds_reach_their_metrics(hall, tmp_path, mixture):
    far = ("--moving-mps", 999, "--collision-m", 999)
    own = measured(hall, "--model", mixture[0], *far, out=tmp_path / "e.json")["hall"]["cv"]
    assert "moving_ade_m" not in own
    assert own["collision_share"] > 0.9  # of two people


def test_the_table_is_the_same_with_and_without_a_file_of_all_figures(hall, tmp_path, mixture, capsys):
    common = ("evaluate", str(hall), "--model", str(mixture[0]), *FAST)
    main([*common])
    brief = capsys.readouterr().out
    main([*common, "--json", str(tmp_path / "e.json")])
    assert capsys.readouterr().out == brief


def test_alone_means_each_person_by_itself(hall, mixture):
    scene, settings = read_scene(hall), EvaluationSettings(bootstrap=1)
    own = Apart.of(scene.trajectories).moved(scene.trajectories)
    alone = dataclasses.replace(scene, trajectories=own)
    robot = predictor_for(scene, mixture[0], learn_trust=False)  # as `--alone` has it
    together = assess(alone, robot, settings)["network"]
    people = scene.trajectories.track_id
    for track in np.unique(people):
        one = dataclasses.replace(scene, trajectories=scene.trajectories.select(people == track))
        own = assess(one, predictor_for(scene, mixture[0]), settings)["network"]
        np.testing.assert_allclose(together.error_m[together.track == track], own.error_m, atol=1e-6)


def test_the_last_line_compares_with_the_best_simple_method(hall, model, capsys):
    main(["evaluate", str(hall), "--model", str(model[0]), *FAST])
    *_, last = capsys.readouterr().out.splitlines()
    assert last.startswith("network: worse than ")
    assert "95 % interval" in last


def test_one_track_has_no_interval(walk, mixture, capsys):
    main(["evaluate", str(walk), "--model", str(mixture[0]), *FAST])
    _, titles, line, *_, last = capsys.readouterr().out.splitlines()
    assert line[titles.index("95 % interval") :][: len("95 % interval")].split() == ["-"]
    assert last.endswith("(one track alone says little of others, so there is no interval)")


@pytest.mark.parametrize(("tracks", "doubted"), [(2, True), (3, True), (9, True), (10, False), (40, False)])
def test_intervals_over_few_tracks_are_doubted(tracks, doubted, tmp_path, mixture, caplog):
    """Of two tracks, a bootstrap interval reaches from one mean to the other: every second one misses."""
    places = [(0.4 * k, who, 0.4 * k, 3.0 * who) for k in range(14) for who in range(tracks)]
    rows = "".join(f"{t:.1f},{who},{x:.1f},{y}\n" for t, who, x, y in places)
    (tmp_path / "few.csv").write_text("time,id,x,y\n" + rows)
    main(["evaluate", str(tmp_path / "few.csv"), "--model", str(mixture[0]), *FAST])
    assert (f"few: 95 % intervals over {tracks} tracks are too narrow" in caplog.text) is doubted


# Forecasts of others


def table_of_forecasts(path, forecasts, every=1):
    with path.open("w") as stream:
        rows = csv.writer(stream)
        rows.writerow(COLUMNS)
        for forecast in list(forecasts)[::every]:
            for n, track in enumerate(forecast.track_id):
                paths, weights = forecast.predictions.path[n], forecast.predictions.weight[n]
                for mode, (steps, weight) in enumerate(zip(paths, weights, strict=True)):
                    for step, (x, y) in enumerate(steps):
                        rows.writerow([track, forecast.time_s, mode, weight, step + 1, x, y])


def test_our_own_forecasts_in_a_table_are_measured_as_ours(hall, tmp_path, mixture):
    scene = open_scene(hall)
    table_of_forecasts(tmp_path / "theirs.csv", replay_scene(scene, predictor_for(scene, mixture[0])))
    given = (hall, "--model", mixture[0], "--forecasts", tmp_path / "theirs.csv")
    figures = measured(*given, out=tmp_path / "e.json")["hall"]
    for metric in ("min_ade_m_k3", "min_fde_m_k6", "most_likely_ade_m"):
        assert figures["theirs"][metric] == pytest.approx(figures["network"][metric], abs=2e-3)
    assert figures["theirs"]["windows"] == figures["network"]["windows"]


def test_methods_are_compared_where_a_table_has_forecasts(hall, tmp_path, mixture, caplog):
    scene = open_scene(hall)
    table_of_forecasts(tmp_path / "rare.csv", replay_scene(scene, predictor_for(scene, mixture[0])), every=5)
    with caplog.at_level("INFO"):
        given = (hall, "--model", mixture[0], "--forecasts", tmp_path / "rare.csv")
        figures = measured(*given, out=tmp_path / "e.json")["hall"]
    usual = measured(hall, "--model", mixture[0], out=tmp_path / "u.json")["hall"]
    assert 0 < figures["cv"]["windows"] == figures["rare"]["windows"] < usual["cv"]["windows"]
    assert "all methods are compared there" in caplog.text


def test_windows_that_others_leave_out_do_not_lack_truth(walk, tmp_path, mixture):
    kept = [line for line in walk.read_text().splitlines() if not line.startswith("8.0,")]
    walk.write_text("\n".join(kept) + "\n")
    (tmp_path / "straight.csv").write_text(straight_lines(12, 0.3))
    usual = measured(walk, "--model", mixture[0], out=tmp_path / "u.json")["walk"]["cv"]
    assert usual["eligible"] > usual["windows"]
    given = ("--forecasts", tmp_path / "straight.csv", "--model", mixture[0])
    one = measured(walk, *given, out=tmp_path / "e.json")["walk"]["cv"]
    assert one["eligible"] == one["windows"] == 1


def straight_lines(rows, step_s):
    """A table that forecasts track 1 of a straight walk at 1 m/s, made at 2.0 s."""
    lines = [f"1,2.0,0,1,{n},{2.0 + step_s * n},0" for n in range(1, rows + 1)]
    return "\n".join([",".join(COLUMNS), *lines]) + "\n"


@pytest.fixture
def walk(tmp_path):
    """One person who walks straight at 1 m/s."""
    rows = [f"{0.4 * k:.1f},1,{0.4 * k:.1f},0" for k in range(30)]
    (tmp_path / "walk.csv").write_text("\n".join(["time,id,x,y", *rows]) + "\n")
    return tmp_path / "walk.csv"


def test_the_largest_id_has_its_forecasts(walk, tmp_path, mixture):
    largest = 2**63 - 1
    walk.write_text(walk.read_text().replace(",1,", f",{largest},"))
    theirs = straight_lines(12, 0.3).replace("\n1,", f"\n{largest},")
    (tmp_path / "straight.csv").write_text(theirs)
    given = ("--forecasts", tmp_path / "straight.csv", "--model", mixture[0])
    figures = measured(walk, *given, out=tmp_path / "e.json")["walk"]
    assert figures["straight"]["windows"] == 1


@pytest.mark.parametrize("step_s", [0.3, 0.4, 0.5])
def test_steps_of_another_length_are_interpolated(walk, step_s, tmp_path, mixture):
    (tmp_path / "straight.csv").write_text(straight_lines(12, step_s))
    given = ("--forecasts", tmp_path / "straight.csv", "--step-s", step_s, "--model", mixture[0])
    figures = measured(walk, *given, out=tmp_path / "e.json")["walk"]
    assert figures["straight"]["ade_m"] == pytest.approx(0.0, abs=1e-5)
    assert figures["straight"]["windows"] == 1


def test_tables_with_steps_of_different_lengths_are_measured_beside_each_other(walk, tmp_path, mixture):
    given = ["--model", mixture[0], "--step-s", 0.4, "--step-s", 0.5]
    for step_s in (0.4, 0.5):
        (tmp_path / f"{step_s}.csv").write_text(straight_lines(12, step_s))
        given += ["--forecasts", tmp_path / f"{step_s}.csv"]
    figures = measured(walk, *given, out=tmp_path / "e.json")["walk"]
    assert [figures[name]["ade_m"] for name in ("0.4", "0.5")] == pytest.approx([0.0, 0.0], abs=1e-5)
    with pytest.raises(SystemExit, match="once for all tables, or once for each of 2"):
        measured(walk, *given, "--step-s", 0.3, out=tmp_path / "e.json")


@pytest.mark.parametrize(
    ("rows", "step_s", "warned"), [(12, 0.3, False), (10, None, False), (11, None, True), (12, None, True)]
)
def test_steps_that_nobody_said_the_length_of_are_doubted(
    rows, step_s, warned, walk, tmp_path, mixture, caplog
):
    """Twelve steps are mostly 0.4 s apart, as in the literature, and windows have ten of 0.3 s."""
    (tmp_path / "straight.csv").write_text(straight_lines(rows, 0.3))
    said = () if step_s is None else ("--step-s", step_s)
    given = ("--forecasts", tmp_path / "straight.csv", "--model", mixture[0], *said)
    measured(walk, *given, out=tmp_path / "e.json")
    text = f"has {rows} steps and windows have 10: its steps are taken to be 0.3 s apart"
    assert (text in caplog.text) is warned


@pytest.mark.parametrize(("factor", "warned"), [(1.0, False), (100.0, True)])
def test_forecasts_in_another_unit_are_warned_about(walk, factor, warned, tmp_path, mixture, caplog):
    head, *rows = straight_lines(12, 0.3).splitlines()
    rows = [row.split(",") for row in rows]
    rows = [",".join([*row[:5], str(factor * float(row[5])), row[6]]) for row in rows]
    (tmp_path / "theirs.csv").write_text("\n".join([head, *rows]))
    measured(walk, "--forecasts", tmp_path / "theirs.csv", "--model", mixture[0], out=tmp_path / "e.json")
    assert ("are x and y those of the recording, in metres?" in caplog.text) is warned


def trajnet(predictions):
    lines = [{"scene": {"id": 7, "p": 1, "s": 0, "e": 200, "fps": 2.5}}]
    lines += [{"track": {"f": 10 * k, "p": 1, "x": 0.4 * k, "y": 0.0}} for k in range(6)]
    for number, side in enumerate(predictions):
        for k in range(6, 18):
            own = {"f": 10 * k, "p": 1, "x": 0.4 * k, "y": side, "prediction_number": number, "scene_id": 7}
            lines.append({"track": own})
    return "\n".join(map(json.dumps, lines))


def test_predictions_of_trajnet_are_measured(walk, tmp_path, mixture):
    (tmp_path / "them.ndjson").write_text(trajnet([0.5, 0.0]))
    given = ("--forecasts", tmp_path / "them.ndjson", "--model", mixture[0])
    figures = measured(walk, *given, out=tmp_path / "e.json")["walk"]["them"]
    assert figures["windows"] == 1
    assert figures["min_ade_m_k3"] == pytest.approx(0.0, abs=1e-5)
    assert figures["ade_m"] > 0.3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("track,time,x,y\n", "no column mode; there are track, time, x, y"),
        (straight_lines(0, 0.3), "no forecasts"),
        (straight_lines(5, 0.3), "reach 1.5 s ahead, and windows need 3 s"),
        (straight_lines(12, 0.3).replace("1,2.0", "8,2.0"), "no forecast belongs to a window of walk"),
        (straight_lines(12, 0.3).replace("1,2.0", "1,2.2"), "no forecast belongs to a window of walk"),
        (straight_lines(12, 0.3).replace(",3,", ",4,"), "track 1 at 2 s needs each step from 1 to"),
        (straight_lines(12, 0.3).replace(",0,1,", ",0,-1,"), "weight = -1"),
        (straight_lines(12, 0.3).replace("5.6", "nan"), "line 13: x is missing"),
        (straight_lines(12, 0.3) + "1,2.0,0\n", "line 14: 3 columns, expected 7"),
        (trajnet([0.0]), "no column track"),
    ],
)
def test_a_wrong_table_of_forecasts_is_refused_with_the_reason(text, message, walk, tmp_path, mixture):
    (tmp_path / "theirs.csv").write_text(text)
    given = ["--model", mixture[0], "--forecasts", tmp_path / "theirs.csv"]
    with pytest.raises(SystemExit, match=message):
        main(["evaluate", str(walk), *map(str, given)])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{}", "no prediction: no track"),
        ("[", "line 1"),
        (trajnet([]), "no prediction"),
        (trajnet([0.0]).replace('"fps": 2.5', '"fps": 0'), "fps"),
        (trajnet([0.0]).replace('"p": 1, "s"', '"p": 2, "s"'), "no forecasts"),
    ],
)
def test_wrong_predictions_of_trajnet_are_refused_with_the_reason(text, message, walk, tmp_path, mixture):
    (tmp_path / "them.ndjson").write_text(text)
    given = ["--model", mixture[0], "--forecasts", tmp_path / "them.ndjson"]
    with pytest.raises(SystemExit, match=message):
        main(["evaluate", str(walk), *map(str, given)])


# Names of forecasts, and options that move people


def test_times_that_are_no_seconds_are_refused_before_a_replay(tmp_path, model, monkeypatch):
    replay = "pedpred.command.prediction.replay_with_progress"
    monkeypatch.setattr(replay, lambda *given: pytest.fail("replay"))
    (tmp_path / "walk.csv").write_text("time,id,x,y\n" + "".join(f"{400 * k},1,{k},0\n" for k in range(9)))
    with pytest.raises(SystemExit, match="looks like milliseconds"):
        main(
            ["predict", str(tmp_path / "walk.csv"), "--model", str(model[0]), "-o", str(tmp_path / "x.mcap")]
        )


@pytest.mark.parametrize("stem", ["network", "cv", "ca", "kalman_cv"])
def test_a_file_named_like_a_method_takes_no_place_but_its_own(
    stem, walk, tmp_path, mixture, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / f"{stem}.csv").write_text(straight_lines(12, 0.3).replace(",0\n", ",1\n"))
    (tmp_path / "mine.csv").write_text(straight_lines(12, 0.3).replace(",0\n", ",1\n"))
    found = measured(walk, "--forecasts", f"{stem}.csv", "--model", mixture[0], out=tmp_path / "a.json")[
        "walk"
    ]
    other = measured(walk, "--forecasts", "mine.csv", "--model", mixture[0], out=tmp_path / "b.json")["walk"]
    assert list(found) == ["cv", "ca", "kalman_cv", "network", f"{stem} ({stem}.csv)"]
    assert found == {f"{stem} ({stem}.csv)" if name == "mine" else name: own for name, own in other.items()}
    assert f"{stem} ({stem}.csv): worse than" in capsys.readouterr().out


def test_two_files_of_one_name_are_both_measured(walk, tmp_path, mixture):
    given = ["--model", mixture[0]]
    for folder, side in {"right": 0, "left": 1}.items():
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "them.csv").write_text(straight_lines(12, 0.3).replace(",0\n", f",{side}\n"))
        given += ["--forecasts", tmp_path / folder / "them.csv"]
    figures = measured(walk, *given, out=tmp_path / "e.json")["walk"]
    right, left = (f"them ({tmp_path / folder / 'them.csv'})" for folder in ("right", "left"))
    assert list(figures)[-2:] == [right, left]
    assert figures[right]["ade_m"] == pytest.approx(0.0, abs=1e-5)
    assert figures[left]["ade_m"] == pytest.approx(1.0, abs=1e-5)
    (tmp_path / "right" / "again.csv").symlink_to(tmp_path / "left" / "them.csv")
    with pytest.raises(SystemExit, match="given twice"):
        measured(walk, *given, "--forecasts", tmp_path / "right" / "again.csv", out=tmp_path / "e.json")


def test_methods_are_compared_where_all_files_have_forecasts(walk, tmp_path, mixture):
    for name, now in {"one": "2.0", "other": "2.4"}.items():
        (tmp_path / f"{name}.csv").write_text(straight_lines(12, 0.3).replace("1,2.0", f"1,{now}"))
    given = [part for name in ("one", "other") for part in ("--forecasts", tmp_path / f"{name}.csv")]
    with pytest.raises(SystemExit, match="no window has a forecast in each of the files"):
        measured(walk, *given, "--model", mixture[0], out=tmp_path / "e.json")


@pytest.mark.parametrize("name", ["network", "cv"])
def test_no_other_method_has_the_name_of_one_that_is_always_there(name, hall, mixture):
    scene = read_scene(hall)
    with pytest.raises(ValueRuleError, match=name):
        assess(scene, predictor_for(scene, mixture[0]), EvaluationSettings(), others={name: None})


AROUND, SEEN = range(4), 16
"""People on circles, and how often each is detected."""


@pytest.fixture(scope="module")
def circles(tmp_path_factory):
    """People on circles, as a table, and forecasts that are right."""
    folder, rng = tmp_path_factory.mktemp("circles"), np.random.default_rng(0)
    seen, ahead = ["time,id,x,y"], [",".join(COLUMNS)]
    for who in AROUND:
        centre, radius, turn = rng.uniform(-8, 8, 2), rng.uniform(2, 4), rng.uniform(0.2, 0.5)
        now = 0.4 * np.arange(5 * who, 5 * who + SEEN)
        at = centre + radius * np.stack([np.cos(turn * now), np.sin(turn * now)], axis=-1)
        seen += [f"{t:.1f},{who},{x},{y}" for t, (x, y) in zip(now, at, strict=True)]
        for t in now:
            for step in range(1, 11):
                angle = turn * (t + 0.3 * step)
                x, y = centre + radius * np.array([np.cos(angle), np.sin(angle)])
                ahead.append(f"{who},{t:.1f},0,1,{step},{x},{y}")
    (folder / "walk.csv").write_text("\n".join(seen) + "\n")
    (folder / "perfect.csv").write_text("\n".join(ahead) + "\n")
    convert = ["convert", str(folder / "walk.csv"), "-o"]
    for name in ("walk.mcap", "walk"):
        main([*convert, str(folder / name)])
    rows = [line.split(",") for line in seen[1:]]
    milliseconds = [f"{round(1000 * float(t))},{rest}" for t, *others in rows for rest in [",".join(others)]]
    (folder / "ms.csv").write_text("\n".join(["time_ms,id,x,y", *milliseconds]) + "\n")
    return folder


ALONE, FREE, MOVED = ("--alone",), ("--no-map",), ("--transform", "30", "-4", "2.1")


@pytest.mark.parametrize("recording", ["walk.csv", "ms.csv", "walk.mcap", "walk"])
@pytest.mark.parametrize("options", [(), ALONE, FREE, MOVED, (*ALONE, *MOVED), (*ALONE, *FREE, *MOVED)])
def test_forecasts_follow_their_people_through_every_option(options, recording, circles, tmp_path, mixture):
    """Those that are right stay right, whatever is done to the scene, in as many windows."""
    given = (circles / recording, "--forecasts", circles / "perfect.csv", "--model", mixture[0])
    (figures,) = measured(*given, *options, out=tmp_path / "e.json").values()
    assert figures["perfect"]["ade_m"] < 0.01
    assert figures["perfect"]["windows"] == len(AROUND) * (SEEN - 3 - 8)
    assert figures["cv"]["ade_m"] > 0.1


def test_tracks_apart_share_no_instant_and_keep_their_times(circles):
    people = open_scene(circles / "walk.csv").trajectories
    apart = Apart.of(people)
    moved = apart.moved(people)
    first, last = ([f(moved.time_s[moved.track_id == who]) for who in AROUND] for f in (np.min, np.max))
    assert (np.subtract(first[1:], last[:-1]) > 9).all()
    for who in AROUND:
        then, now = (p.time_s[p.track_id == who] for p in (people, moved))
        np.testing.assert_allclose(np.diff(now), np.diff(then), atol=1e-9)
    stranger = dataclasses.replace(people, track_id=people.track_id + 100)
    np.testing.assert_array_equal(apart.moved(stranger).time_s, stranger.time_s)
