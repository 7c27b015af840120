"""Recordings in single files: TrajNet++, texts and tables, and clocks that count something else."""

import logging

import numpy as np
import pytest

from pedpred.command import main
from pedpred.errors import SourceError
from pedpred.scenes import Trajectories
from pedpred.sources.scene_folder import read_folder
from pedpred.sources.single_file import read_file
from pedpred.sources.trajnet import read_ndjson
from pedpred.storage.scenes import read_scene
from pedpred.tables.options import TableOptions
from tests.field_formats import trajnet_scene, write_trajnet
from tests.scenes import assert_same

ROWS = [(k, who, 0.5 * k + who, -0.25 * k) for k in range(5) for who in (3, 7)]
TRACKS = Trajectories([0.5 * k for k, *_ in ROWS], [r[1] for r in ROWS], [r[2:] for r in ROWS])
SCENE = trajnet_scene(2.0)


def test_a_rate_may_stand_for_the_scenes_of_trajnet(tmp_path):
    path = write_trajnet(tmp_path, ROWS, 2.0)
    assert_same(read_ndjson(path), TRACKS)
    path.write_text(path.read_text().replace(SCENE, ""))
    assert_same(read_ndjson(path, TableOptions(rate_hz=12.0)), TRACKS)


@pytest.mark.parametrize("nowhere", ["NaN", "null"])
def test_trajnet_may_miss_positions(tmp_path, nowhere, caplog):
    path = write_trajnet(tmp_path, ROWS, 2.0)
    whole = read_ndjson(path)
    lost = f'{{"track": {{"f": 900, "p": 3, "x": {nowhere}, "y": {nowhere}}}}}'
    path.write_text(f"{path.read_text()}{lost}\n")
    with caplog.at_level(logging.WARNING):
        np.testing.assert_array_equal(read_ndjson(path).position, whole.position)
    assert "rows without a position are missing detections" in caplog.text


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('"f": 6, "p": 3', '"f": 6.5, "p": 3', "line 4: f = 6.5, but it must be a whole number"),
        ('"f": 6, "p": 3', '"f": 0, "p": 3', "line 4: track_id 3 and frame 0 again, first in line 2"),
        ('"x": 3.5', '"x": "far"', "line 4: x = \"'far'\" is not a number"),
        ('"x": 3.5', '"x": Infinity', "line 4: ValueError: Infinity is not a number"),
        ('"x": 3.5, ', "", "line 4: 'x' is missing"),
        ('"x": 3.5', '"prediction_number": 0, "x": 3.5', "line 4: a forecast"),
        ('{"track": {"f": 6, "p": 3', '["track", {"f": 6, "p": 3', "line 4: JSONDecodeError"),
        ('"fps": 2.0', '"fps": 0', r"fps of the scenes: 0.*--rate"),
        (SCENE, "[1, 2]", r"line 1: \[1, 2\] where an object is expected.*TrajNet"),
        (SCENE, '{"scene": 3}', "line 1: 3 where an object is expected.*TrajNet"),
        (SCENE, "", r"fps of the scenes: none.*--rate"),
    ],
)
def test_what_is_wrong_with_trajnet_is_said(tmp_path, old, new, named):
    path = write_trajnet(tmp_path, ROWS, 2.0)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(SourceError, match=named):
        read_ndjson(path)


def write_table(path, rows, header="time,id,x,y"):
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]))
    return path


@pytest.mark.parametrize(
    ("factor", "unit"),
    [(1000, "milliseconds"), (10**6, "microseconds"), (10**9, "nanoseconds"), (12, "frame numbers")],
)
def test_a_clock_that_does_not_count_seconds_is_recognised(tmp_path, factor, unit):
    for start in (0, 0 if factor == 12 else 1_700_000_000):
        rows = [(start * factor + k * factor // 2, *rest) for k, *rest in ROWS]
        with pytest.raises(SourceError, match=f"looks like .*{unit}.*seconds"):
            read_file(write_table(tmp_path / "walk.csv", rows))


def test_the_clock_of_a_folder_of_ones_own_is_checked_too(tmp_path):
    main(["convert", str(write_trajnet(tmp_path, ROWS, 2.0)), "-o", str(tmp_path / "own")])
    assert read_folder(tmp_path / "own", "mine", {}).name == "mine"
    (tmp_path / "own/tracks.parquet").unlink()
    write_table(tmp_path / "own/tracks.csv", [(500 * k, *rest) for k, *rest in ROWS])
    with pytest.raises(SourceError, match="looks like milliseconds"):
        read_folder(tmp_path / "own", "mine", {})


@pytest.mark.parametrize("header", ["# framerate: 2\n# id frame x/m y/m", "time id x y"])
def test_a_text_is_that_of_a_laboratory_or_a_table(tmp_path, header):
    path = tmp_path / "walk.txt"
    order = (lambda k, who: (who, k)) if "frame" in header else (lambda k, who: (k / 2, who))
    lines = [" ".join(map(str, (*order(k, who), x, y))) for k, who, x, y in ROWS]
    path.write_text("\n".join([header, *lines]))
    assert_same(read_file(path).trajectories, TRACKS)


def test_lines_of_json_that_are_no_tracks_are_told_what_to_be(tmp_path):
    (tmp_path / "walk.ndjson").write_text('{"time": 0, "id": 1, "x": 1, "y": 2}\n' * 3)
    with pytest.raises(SourceError, match=r"no line with a track.*Save others as CSV"):
        read_file(tmp_path / "walk.ndjson")


def test_nobody_twice_is_said(tmp_path):
    with pytest.raises(
        SourceError, match=r"walk\.csv: .*no pedestrian was detected twice.*several detections"
    ):
        read_file(write_table(tmp_path / "walk.csv", ROWS[:2]))


@pytest.mark.parametrize("row", [None, "#0,1,1,1", "0,1,,"])
def test_a_table_of_nobody_is_not_asked_for_other_ids(tmp_path, row):
    (tmp_path / "walk.csv").write_text("\n".join(["time,id,x,y", *([row] if row else [])]))
    with pytest.raises(
        SourceError, match=r"walk\.csv: no detections: no row.*Name a file with tracks"
    ) as refused:
        read_file(tmp_path / "walk.csv")
    assert "--columns" not in str(refused.value)


def test_the_command_takes_columns_and_a_rate(tmp_path):
    path = tmp_path / "walk.csv"
    path.write_text("\n".join(";".join(map(str, (who, k, "a", x, y))) for k, who, x, y in ROWS))
    options = ["--columns", "id,frame,_,x,y", "--rate", "2"]
    main(["convert", str(path), "-o", str(tmp_path / "walk"), *options])
    assert_same(read_scene(tmp_path / "walk").trajectories, TRACKS)
    with pytest.raises(SystemExit, match=r"line 1: x = 'a' is not a number.*--columns"):
        main(["info", str(path)])


def test_a_folder_with_a_table_is_not_converted_into_itself(tmp_path):
    """Otherwise later corrections of the table would lose against what was converted."""
    main(["convert", str(write_trajnet(tmp_path, ROWS, 2.0)), "-o", str(tmp_path / "own")])
    (tmp_path / "own/tracks.parquet").unlink()
    write_table(tmp_path / "own/tracks.csv", [(k / 2, *rest) for k, *rest in ROWS])
    before = {path.name: path.read_bytes() for path in (tmp_path / "own").iterdir()}
    with pytest.raises(SystemExit, match=r"own: .* is an input of this command"):
        main(["convert", str(tmp_path / "own"), "-o", str(tmp_path / "own"), "--force"])
    assert {path.name: path.read_bytes() for path in (tmp_path / "own").iterdir()} == before


@pytest.mark.parametrize("command", ["convert", "predict"])
def test_a_layout_beside_a_recording_is_not_overwritten_unasked(tmp_path, command):
    path = write_table(tmp_path / "walk.csv", [(k / 2, *rest) for k, *rest in ROWS])
    (tmp_path / "out.foxglove.json").write_text("precious")
    with pytest.raises(SystemExit, match=r"out\.foxglove\.json is there already; --force"):
        main([command, str(path), "-o", str(tmp_path / "out.mcap")])
    assert (tmp_path / "out.foxglove.json").read_text() == "precious"
    assert not (tmp_path / "out.mcap").exists()


@pytest.mark.parametrize(("command", "name"), [("convert", "x.csv"), ("predict", "x"), ("predict", "x.xlsx")])
def test_the_name_of_an_output_says_what_it_is(tmp_path, command, name):
    path = write_table(tmp_path / "walk.csv", [(k / 2, *rest) for k, *rest in ROWS])
    with pytest.raises(SystemExit, match=r"ends in \.mcap"):
        main([command, str(path), "-o", str(tmp_path / name)])
    assert not (tmp_path / name).exists()


def test_a_folder_with_a_dot_in_its_name_is_told_so(tmp_path):
    with pytest.raises(SystemExit, match=r"hall\.v2', but a name ends in \.mcap, or has no dot"):
        main(["convert", "examples/crossing/tracks.csv", "-o", str(tmp_path / "hall.v2")])


def test_every_table_bounds_what_it_reads(tmp_path, monkeypatch):
    monkeypatch.setattr("pedpred.tables.text.MOST_NUMBERS", 20)
    write_table(tmp_path / "walk.csv", [(k / 2, *rest) for k, *rest in ROWS])
    (tmp_path / "walk.tsv").write_text((tmp_path / "walk.csv").read_text())
    (tmp_path / "walk.txt").write_text("\n".join(f"{who} {k} {x} {y}" for k, who, x, y in ROWS))
    for suffix in (".csv", ".tsv", ".txt"):
        with pytest.raises(SourceError, match="more than 4 rows"):
            read_file(tmp_path / f"walk{suffix}", TableOptions(rate_hz=2.0))


def test_a_scene_is_named_after_its_file_and_lies_on_free_ground(tmp_path):
    scene = read_file(write_table(tmp_path / "walk.csv", [(k / 2, *rest) for k, *rest in ROWS]))
    assert (scene.name, scene.detection_dt_s) == ("walk", 0.5)
    assert not scene.occupancy.occupied.any()
    assert np.ptp(scene.trajectories.time_s) == 2.0
