"""The command line: recordings in, recordings and folders out."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from pedpred.command import main
from pedpred.command.recordings import OpenOptions, open_recording, open_scene, read_ground_at
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.reading.options import ReadOptions
from pedpred.ros import Transform, write_recording
from pedpred.storage.maps import write_map
from pedpred.storage.scenes import read_scene, write_scene
from tests.conftest import ROOT
from tests.refused import refused, unread
from tests.scenes import assert_same
from tests.worlds import walled_scene

CORNER = ROOT / "examples/corner"


@pytest.fixture
def scene(tmp_path):
    world = walled_scene(np.random.default_rng(2), 0.4, detections=12, tracks=2)
    write_scene(world, tmp_path / "hall")
    return tmp_path / "hall"


@pytest.fixture
def recordings(tmp_path, scene):
    """The same people as a folder, a table and a bag."""
    people = read_scene(scene).trajectories
    columns = zip(people.time_s, people.track_id, *people.position.T, strict=True)
    rows = [",".join(map(str, row)) for row in columns]
    (tmp_path / "walk.csv").write_text("\n".join(["time,id,x,y", *rows]))
    write_recording(read_scene(scene), tmp_path / "walk.mcap")
    return {"folder": scene, "table": tmp_path / "walk.csv", "bag": tmp_path / "walk.mcap"}


# Opening


@pytest.mark.parametrize("kind", ["folder", "table", "bag"])
def test_all_kinds_of_recordings_have_the_same_people(kind, recordings, scene):
    """Also where a transform moves them."""
    expected, found = read_scene(scene).trajectories, open_scene(recordings[kind]).trajectories
    np.testing.assert_allclose(found.time_s, expected.time_s, atol=1e-9)
    np.testing.assert_array_equal(found.track_id, expected.track_id)
    np.testing.assert_allclose(found.position, expected.position, atol=1e-9)
    moved = open_scene(recordings[kind], OpenOptions(transform=Transform(1.0, -2.0, np.pi / 2)))
    x, y = expected.position.T
    np.testing.assert_allclose(moved.trajectories.position, np.stack([1.0 - y, x - 2.0], axis=-1), atol=1e-6)


def test_an_option_that_a_kind_does_not_use_is_refused(recordings):
    for kind, field, options in (
        ("folder", "unit", OpenOptions(ReadOptions(unit="cm"))),
        ("folder", "classes", OpenOptions(ReadOptions(classes=("person",)))),
        ("folder", "topic", OpenOptions(topic="/a")),
        ("table", "topic", OpenOptions(topic="/people")),
        ("table", "identities", OpenOptions(identities="given")),
        ("bag", "unit", OpenOptions(ReadOptions(unit="cm"))),
        ("bag", "columns", OpenOptions(ReadOptions(columns=("time", "id", "x", "y")))),
    ):
        with refused(field):
            open_recording(recordings[kind], options)


def test_a_folder_of_other_files_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("time to go")
    with unread(tmp_path, remedy="--one-person-per-file"):
        open_recording(tmp_path)


def test_people_are_on_the_map_beside_them_or_another(recordings, scene, tmp_path):
    """A folder and a bag have maps of their own."""
    own = read_scene(scene).occupancy
    write_map(own, tmp_path)
    (tmp_path / "other").mkdir()
    write_map(replace(own, occupied=~own.occupied), tmp_path / "other")
    for recording in recordings.values():
        np.testing.assert_array_equal(open_scene(recording).occupancy.occupied, own.occupied)
        assert not open_scene(recording, OpenOptions(no_map=True)).occupancy.occupied.any()
        other = open_scene(recording, OpenOptions(map=tmp_path / "other")).occupancy
        np.testing.assert_array_equal(other.occupied, ~own.occupied)


def test_a_map_beside_a_table_of_people_elsewhere_is_not_used(recordings, scene, tmp_path):
    own = read_scene(scene).occupancy
    write_map(replace(own, origin=own.origin + 1000.0), tmp_path)
    assert not open_scene(recordings["table"]).occupancy.occupied.any()


def test_a_geometry_is_a_map_with_open_ends():
    ends = (((-3.0, 5.0), (0.0, 5.0)), ((5.0, 0.0), (5.0, -3.0)))
    closed, opened = (read_ground_at(CORNER / "walls.xml", some) for some in ((), ends))
    beyond = [[-1.5, 6.0], [6.0, -1.5]]
    assert closed.is_occupied(beyond).all()
    assert not opened.is_occupied(beyond).any()
    for options in ({"open_ends": ends}, {"open_ends": ends, "map": CORNER.parent / "crossing"}):
        with refused("open_ends"):
            open_scene(CORNER / "walk.txt", OpenOptions(**options))


def test_fields_and_identities_are_those_of_a_bag(scene, tmp_path):
    """The standard fields of people_msgs/People, said by hand; assigned ids are of as many people."""
    write_recording(read_scene(scene), tmp_path / "walk.mcap")
    usual = open_scene(tmp_path / "walk.mcap").trajectories
    named = OpenOptions(topic="/people", people="people,id=name,position=position", identities="given")
    found = open_scene(tmp_path / "walk.mcap", named).trajectories
    np.testing.assert_array_equal(found.track_id, usual.track_id)
    np.testing.assert_array_equal(found.position, usual.position)
    assigned = open_scene(tmp_path / "walk.mcap", OpenOptions(identities="assigned")).trajectories
    np.testing.assert_array_equal(np.sort(assigned.position, axis=0), np.sort(usual.position, axis=0))


# Commands


def test_a_converted_recording_has_the_same_people_and_map(scene, tmp_path):
    was, folder, bag = read_scene(scene), tmp_path / "folder", tmp_path / "hall.mcap"
    main(["convert", str(scene), "-o", str(folder)])
    assert_same(read_scene(folder), was)
    main(["convert", str(scene), "-o", str(bag)])
    main(["convert", str(bag), "-o", str(tmp_path / "again")])
    found = read_scene(tmp_path / "again")
    np.testing.assert_allclose(found.trajectories.position, was.trajectories.position, atol=1e-9)
    np.testing.assert_array_equal(found.occupancy.occupied, was.occupancy.occupied)


def test_predictions_of_the_command_are_those_of_the_predictor(scene, tmp_path, model):
    main(["predict", str(scene), "--model", str(model[0]), "-o", str(tmp_path / "f.parquet")])
    table = pd.read_parquet(tmp_path / "f.parquet").sort_values("step")
    paths = {key: rows[["x", "y"]].to_numpy() for key, rows in table.groupby(["track", "time", "mode"])}
    world = read_scene(scene)
    robot = OnlinePredictor.load(model[0], OnlineSettings(max_age_s=0.5))
    robot.set_map(world.occupancy)
    compared = 0
    for now in np.unique(world.trajectories.time_s):
        people = world.trajectories.select(world.trajectories.time_s == now)
        forecast = robot.update(float(now), people.track_id, people.position)
        for track, path in zip(forecast.track_id.tolist(), forecast.position, strict=True):
            np.testing.assert_allclose(paths[track, now, 0], path, atol=1e-6)
            compared += 1
    assert compared == len(paths) > 10


def test_info_describes_each_recording(scene, capsys):
    main(["info", str(scene), str(ROOT / "examples/crossing")])
    lines = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines() if line]
    assert [rest for key, rest in lines if key == "name"] == [read_scene(scene).name, "crossing"]
    assert sum("2 tracks" in rest for _, rest in lines) == 1


def test_own_tracks_in_a_table_are_measured(tmp_path, model):
    """Two people walk straight on at 5 Hz: every detection with three more seconds is a window."""
    rows = [f"{0.2 * k},{who},{0.24 * k * way},{who}.5" for k in range(24) for who, way in ((1, 1), (2, -1))]
    (tmp_path / "hall.csv").write_text("\n".join(["time,id,x,y", *rows]))
    out = tmp_path / "e.json"
    main(["evaluate", str(tmp_path / "hall.csv"), "--model", str(model[0]), "--json", str(out)])
    figures = json.loads(out.read_text())["hall"]
    assert set(figures) == {"cv", "ca", "kalman_cv", "network"}
    last = int((23 * 0.2 - 3.0) / 0.2)
    assert {own["windows"] for own in figures.values()} == {2 * (last + 1 - 3)}
    assert figures["cv"]["ade_m"] == pytest.approx(0.0, abs=1e-4)


# Help


def test_help_needs_no_torch():
    checked = "import sys, pedpred.command.arguments; assert 'torch' not in sys.modules; "
    command = [sys.executable, "-c", checked + "pedpred.command.main(['--help'])"]
    assert subprocess.run(command, capture_output=True, check=False, cwd=ROOT).returncode == 0


def test_a_missing_library_is_named_with_its_extra():
    script = "import sys; sys.modules['pandas'] = None; from pedpred.command import main; main(['info', 'x'])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "pip install 'pedpred[files]'" in done.stderr
