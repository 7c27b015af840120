"""The command line: scenes in, recordings and folders out, errors as sentences."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from pedpred.command import main
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.storage.scenes import read_scene, write_scene
from tests.worlds import walled_scene


@pytest.fixture
def scene(tmp_path):
    world = walled_scene(np.random.default_rng(2), 0.4, detections=12, tracks=2)
    write_scene(world, tmp_path / "hall")
    return tmp_path / "hall"


def test_there_and_back_changes_nothing(scene, tmp_path):
    main(["convert", str(scene), "-o", str(tmp_path / "hall.mcap")])
    main(["convert", str(tmp_path / "hall.mcap"), "-o", str(tmp_path / "again")])
    one, two = read_scene(scene), read_scene(tmp_path / "again")
    assert one.name == two.name
    assert one.detection_dt_s == two.detection_dt_s
    for part in ("recording", "occupancy"):
        for field in dataclasses.fields(getattr(one, part)):
            a, b = (getattr(getattr(world, part), field.name) for world in (one, two))
            np.testing.assert_array_equal(a, b, err_msg=field.name)


def test_predictions_in_a_recording_are_those_of_the_predictor(scene, tmp_path, model):
    main(["predict", str(scene), "--model", str(model[0]), "-o", str(tmp_path / "hall.mcap")])
    lines = {}
    with (tmp_path / "hall.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, _, message, content in reader.iter_decoded_messages(topics=["/markers"]):
            for marker in (marker for marker in content.markers if marker.ns == "pedpred"):
                points = [(point.x, point.y) for point in marker.points]
                lines[message.log_time, marker.id] = np.array(points)
    world = read_scene(scene)
    robot = OnlinePredictor.load(model[0], OnlineSettings(max_age_s=0.5))
    robot.set_map(world.occupancy)
    compared = 0
    for now in np.unique(world.recording.time_s):
        here = world.recording.time_s == now
        forecast = robot.update(float(now), world.recording.track_id[here], world.recording.position[here])
        for track, path in zip(forecast.track_id.tolist(), forecast.position, strict=True):
            np.testing.assert_allclose(lines[round(now * 1e9), int(track)][1:], path, atol=1e-6)
            compared += 1
    assert compared == len(lines) > 10


def test_info_tells_what_is_there(scene, capsys):
    main(["info", str(scene)])
    said = capsys.readouterr().out
    assert "2 tracks" in said
    assert "20.0 m x 20.0 m" in said


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
    script = (
        "import sys, pedpred.command; assert 'torch' not in sys.modules; pedpred.command.main(['--help'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parents[1],
    )
    assert done.returncode == 0, done.stderr
    assert "predict" in done.stdout
