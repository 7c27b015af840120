"""The command line: scenes in, recordings and folders out, errors without a traceback."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from pedpred.command import main
from pedpred.command.conversion import read_any
from pedpred.command.maps import map_at
from pedpred.errors import InputError, ValueRuleError
from pedpred.evaluation import EvaluationSettings
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.reading import FORMATS
from pedpred.reading.options import ReadOptions
from pedpred.ros import write_recording
from pedpred.storage.scenes import read_scene, write_map, write_scene
from tests.conftest import ROOT
from tests.scenes import assert_same
from tests.test_recording import decoded
from tests.worlds import walled_scene


@pytest.fixture
def scene(tmp_path):
    world = walled_scene(np.random.default_rng(2), 0.4, detections=12, tracks=2)
    write_scene(world, tmp_path / "hall")
    return tmp_path / "hall"


def test_there_and_back_changes_nothing(scene, tmp_path):
    main(["convert", str(scene), "-o", str(tmp_path / "hall.mcap")])
    main(["convert", str(tmp_path / "hall.mcap"), "-o", str(tmp_path / "again")])
    assert_same(read_scene(scene), read_scene(tmp_path / "again"))


def test_predictions_in_a_recording_are_those_of_the_predictor(scene, tmp_path, model):
    main(["predict", str(scene), "--model", str(model[0]), "-o", str(tmp_path / "hall.mcap")])
    lines = {}
    for _, channel, message, content in decoded(tmp_path / "hall.mcap")[1]:
        for marker in content.markers if channel.topic == "/markers" else ():
            if marker.ns == "pedpred":
                lines[message.log_time, marker.id] = np.array([(p.x, p.y) for p in marker.points])
    world = read_scene(scene)
    robot = OnlinePredictor.load(model[0], OnlineSettings(max_age_s=0.5))
    robot.set_map(world.occupancy)
    compared = 0
    for now in np.unique(world.trajectories.time_s):
        here = world.trajectories.time_s == now
        people = world.trajectories.select(here)
        forecast = robot.update(float(now), people.track_id, people.position)
        for track, path in zip(forecast.track_id.tolist(), forecast.position, strict=True):
            np.testing.assert_allclose(lines[round(now * 1e9), int(track)][1:], path, atol=1e-6)
            compared += 1
    assert compared == len(lines) > 10


def test_info_tells_what_is_there(scene, capsys):
    main(["info", str(scene)])
    said = capsys.readouterr().out
    assert "2 tracks" in said
    assert "20.0 m x 20.0 m" in said


@pytest.mark.parametrize("name", [".", "map.yaml", "map.pgm", "hall.yaml", "hall.png", "hall.yml"])
def test_a_map_may_be_named_by_its_folder_its_description_or_its_picture(name, scene, tmp_path):
    folder, world = tmp_path / "maps", read_scene(scene)
    write_scene(world, folder)
    if name.startswith("hall"):
        about = yaml.safe_load((folder / "map.yaml").read_text())
        picture = Image.open(folder / about["image"])
        for old in (folder / "map.yaml", folder / about["image"]):
            old.unlink()
        picture.save(folder / "hall.png")
        described = name if name.endswith("ml") else "hall.yaml"
        (folder / described).write_text(yaml.safe_dump(about | {"image": "hall.png"}))
    assert_same_map(map_at(folder / name), world.occupancy)


@pytest.mark.parametrize(
    ("given", "expected"), [([], "beside"), (["--no-map"], "free"), (["--map", "."], "other")]
)
def test_a_table_uses_the_map_beside_it_unless_told_otherwise(given, expected, scene, tmp_path, caplog):
    world = read_scene(scene)
    write_scene(world, tmp_path / "hall")
    table = tmp_path / "hall" / "walk.csv"
    rows = world.trajectories
    columns = zip(rows.time_s, rows.track_id, *rows.position.T, strict=True)
    table.write_text("time,id,x,y\n" + "".join(f"{t},{n},{x},{y}\n" for t, n, x, y in columns))
    other = replace(world, occupancy=replace(world.occupancy, occupied=~world.occupancy.occupied))
    write_scene(other, tmp_path / "other")
    options = [str(tmp_path / "other") if word == "." else word for word in given]
    with caplog.at_level("INFO"):
        main(["convert", str(table), "-o", str(tmp_path / "out"), *options])
    found = read_scene(tmp_path / "out").occupancy
    assert ("map.yaml beside it is used" in caplog.text) == (expected == "beside")
    if expected == "free":
        assert not found.occupied.any()
    else:
        assert_same_map(found, {"beside": world, "other": other}[expected].occupancy)


def assert_same_map(found, expected):
    np.testing.assert_array_equal(found.occupied, expected.occupied)
    np.testing.assert_allclose(found.origin, expected.origin)
    assert found.resolution_m == expected.resolution_m


@pytest.mark.parametrize(
    ("files", "asked", "message"),
    [
        ({"x.png": b""}, "x.png", "neither x.yaml nor map.yaml beside it describes this picture"),
        ({"x.png": b"", "x.yaml": b"image: y.png"}, "x.png", "neither x.yaml nor map.yaml"),
        ({"x.yaml": b"image: x.png"}, "x.yaml", "'origin' is missing"),
        ({"x.yaml": b"{"}, "x.yaml", "x.yaml"),
        ({"x.yaml": b"{image: ../x.png, origin: [0, 0, 0], negate: 0}"}, "x.yaml", "beside x.yaml"),
        ({"x.yaml": b"{image: x.png, origin: [0, 0, .nan]}"}, "x.yaml", "yaw"),
    ],
)
def test_a_map_that_cannot_be_read_says_why(files, asked, message, tmp_path):
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        map_at(tmp_path / asked)


def test_an_mcap_bag_with_one_topic_of_people_needs_no_topic(capsys):
    bag = str(ROOT / "examples/corner/people.mcap")
    main(["info", bag])
    without = capsys.readouterr().out
    main(["info", bag, "--topic", "/tracked_people"])
    assert capsys.readouterr().out == without


def test_a_recording_without_obstacles_says_so_before_it_is_forecast(caplog, capsys, tmp_path):
    bag, out = str(ROOT / "examples/corner/people.mcap"), str(tmp_path / "out.csv")
    main(["info", bag])
    assert "no obstacles are known" in capsys.readouterr().out
    for options, expected in (([], True), (["--no-map"], False)):
        caplog.clear()
        main(["predict", bag, "-o", out, "--force", *options])
        assert ("--map" in caplog.text) == expected


def test_info_tells_about_several_scenes(scene, capsys):
    main(["info", str(scene), str(ROOT / "examples/crossing")])
    names = [line.split()[1] for line in capsys.readouterr().out.splitlines() if "name  " in line]
    assert names == [read_scene(scene).name, "crossing"]


def test_nothing_is_overwritten_unasked(scene, tmp_path):
    target = tmp_path / "hall.mcap"
    target.write_text("precious")
    with pytest.raises(SystemExit, match="--force"):
        main(["convert", str(scene), "-o", str(target)])
    assert target.read_text() == "precious"
    main(["convert", str(scene), "-o", str(target), "--force"])
    assert target.read_bytes().startswith(b"\x89MCAP")


@pytest.mark.parametrize("command", ["info", "convert -o x", "predict -o x.mcap --model nowhere"])
def test_an_error_is_a_sentence_that_names_the_file(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name, *rest = command.split()
    with pytest.raises(SystemExit, match=r"Error: .*missing\.mcap"):
        main([name, "missing.mcap", *rest])


def test_help_is_there_and_needs_no_torch():
    checked = "import sys, pedpred.command.arguments; assert 'torch' not in sys.modules; "
    command = [sys.executable, "-c", checked + "pedpred.command.main(['--help'])"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert "predict" in done.stdout


@pytest.mark.parametrize("command", ["info", "convert", "predict", "evaluate", "drive"])
def test_help_names_every_format_that_is_read(command, capsys):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    told = "".join(capsys.readouterr().out.split())
    assert [reader.NAME for reader in FORMATS if "".join(reader.NAME.split()) not in told] == []
    assert all(name in told for name in ("Parquet", "Feather"))


def test_no_message_names_the_pipeline_that_made_the_files():
    names = "[m.__file__ for name, m in sys.modules.items() if name.startswith('pedpred')]"
    script = f"import sys, pedpred.command.arguments; print(*{names})"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    files = [Path(name) for name in done.stdout.split()]
    assert len(files) > 30
    assert not [file.name for file in files if "dvc" in file.read_text()]


def test_own_tracks_in_a_table_are_measured(tmp_path, model, capsys):
    """Two people walk straight on at 5 Hz: every detection with three more seconds is a window."""
    rows = [f"{0.2 * k},{who},{0.24 * k * way},{who}.5" for k in range(30) for who, way in ((1, 1), (2, -1))]
    (tmp_path / "hall.csv").write_text("\n".join(["time,id,x,y", *rows]))
    out = tmp_path / "e.json"
    main(["evaluate", str(tmp_path / "hall.csv"), "--model", str(model[0]), "--json", str(out)])
    figures = json.loads(out.read_text())["hall"]
    assert set(figures) == {"cv", "ca", "kalman_cv", "network"}
    last = int((29 * 0.2 - 3.0) / 0.2)
    assert {own["windows"] for own in figures.values()} == {2 * (last + 1 - 3)}
    assert figures["cv"]["ade_m"] == pytest.approx(0.0, abs=1e-4)
    robot = OnlinePredictor.load(model[0])
    errors = []
    for k in range(last + 1):
        forecast = robot.update(0.2 * k, [1, 2], [[0.24 * k, 1.5], [-0.24 * k, 2.5]])
        ahead = 1.2 * (0.2 * k + 0.3 * np.arange(1, 11))
        truth = np.stack([np.stack([s * ahead, np.full(10, y)], axis=-1) for s, y in ((1, 1.5), (-1, 2.5))])
        errors += [] if k < 3 else [np.linalg.norm(forecast.position - truth, axis=-1).mean()]
    assert figures["network"]["ade_m"] == pytest.approx(np.mean(errors), abs=1e-4)
    assert "hall: 24 windows of 2 tracks" in capsys.readouterr().out


def test_what_counts_is_what_the_published_metrics_count():
    options = yaml.safe_load((ROOT / "conf/evaluation/paper.yaml").read_text())
    usual = EvaluationSettings()
    assert (options["moving_mps"], options["collision_m"]) == (usual.moving_mps, usual.collision_m)


def test_a_map_of_a_type_that_is_not_read_is_named_beside_those_that_are(tmp_path):
    (tmp_path / "room.dxf").write_text("0\nSECTION\n")
    with pytest.raises(InputError, match=r"files of type \.dxf are not read.*map\.yaml.*\.xml, \.wkt"):
        map_at(tmp_path / "room.dxf")


def test_a_picture_of_any_suffix_is_a_map_where_a_file_describes_it(tmp_path):
    world = walled_scene(np.random.default_rng(0)).occupancy
    write_map(world, tmp_path)
    about = (tmp_path / "map.yaml").read_text()
    for name in ("map.PGM", "map.image"):
        (tmp_path / "map.pgm").rename(tmp_path / name)
        (tmp_path / "map.yaml").write_text(about.replace("map.pgm", name))
        np.testing.assert_array_equal(map_at(tmp_path / name).occupied, world.occupied)
        (tmp_path / name).rename(tmp_path / "map.pgm")


@pytest.mark.parametrize("name", ["walk.mcap", "walk.bag", "scene"])
@pytest.mark.parametrize(
    ("option", "given"),
    {
        "--unit": {"unit": "mm"},
        "--scale": {"pixel_m": 0.1},
        "--rate": {"rate_hz": 10.0},
        "--columns": {"columns": ("time", "id", "x", "y")},
    }.items(),
)
def test_an_option_without_a_meaning_is_refused(tmp_path, name, option, given):
    (tmp_path / "scene").mkdir()
    with pytest.raises(ValueRuleError, match=rf"{option} = .*{name} says it itself"):
        read_any(tmp_path / name, options=ReadOptions(**given))


@pytest.mark.parametrize("name", ["walk.csv", "scene", "scene.mcap"])
@pytest.mark.parametrize("option", ["--topic", "--map-topic", "--class"])
def test_what_bags_alone_have_is_refused_elsewhere(tmp_path, name, option):
    """A recording of the package is read as a bag where a topic is named."""
    scene = walled_scene(np.random.default_rng(0))
    write_scene(scene, tmp_path / "scene")
    write_recording(scene, tmp_path / "scene.mcap")
    rows = [f"{k},{who},{k},{who}" for k in range(3) for who in (1, 2)]
    (tmp_path / "walk.csv").write_text("\n".join(["time,id,x,y", *rows]))
    with pytest.raises(
        SystemExit, match=r"is no bag|no column holds classes|all in it are people|nothing carries no"
    ):
        main(["info", str(tmp_path / name), option, "nothing"])


def test_a_table_of_forecasts_has_no_occupancy(tmp_path):
    given = ["predict", str(ROOT / "examples/crossing"), "-o", str(tmp_path / "f.csv"), "--grid", "0.5"]
    with pytest.raises(SystemExit, match="--grid"):
        main(given)
    assert not list(tmp_path.iterdir())
