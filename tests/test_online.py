"""On the robot: the same forecasts as offline, whatever the stream does."""

import copy
import json
import pickle
import shutil
from dataclasses import replace

import numpy as np
import onnx
import pytest
import torch

from pedpred.errors import InputError
from pedpred.online import OnlinePredictor, OnlineSettings, shipped
from pedpred.online.caution import moving_shares, shorten_paths
from pedpred.online.network import write_description
from pedpred.scenes import OccupancyMap, Predictions
from tests.conftest import ROOT
from tests.exported import export
from tests.refused import refused, unread


def test_the_frame_rate_is_free(model):
    """The same walk seen at 10 and at 30 Hz, exactly: the steps in between leave the memory alone."""
    robots = [OnlinePredictor.load(model[0]) for _ in range(2)]
    last = []
    for robot, rate in zip(robots, (10, 30), strict=True):
        for k in range(3 * rate + 1):
            now = k / rate
            forecast = robot.update(now, [4, 9], [[now, 0.0], [5.0 - now, 1.0]], [[1.0, 0.0], [-1.0, 0.0]])
        last.append(forecast)
    np.testing.assert_allclose(last[0].position, last[1].position, atol=1e-4)


def test_memory_matters_and_a_lost_track_starts_from_zero(model):
    robot = OnlinePredictor.load(model[0])
    first = robot.update(0.0, [1], [[0.0, 0.0]], [[1.0, 0.0]])
    later = robot.update(0.6, [1], [[0.0, 0.0]], [[1.0, 0.0]])
    assert np.abs(later.position - first.position).max() > 1e-3
    back = robot.update(9.0, [1], [[0.0, 0.0]], [[1.0, 0.0]])
    np.testing.assert_allclose(back.position, first.position, atol=1e-6)


def test_whoever_is_not_detected_is_extrapolated_then_gone(model):
    robot = OnlinePredictor.load(model[0])
    robot.update(0.0, [1, 2], [[0.0, 0.0], [3.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]])
    assert robot.update(0.3, [2], [[3.0, 0.0]], [[0.0, 0.0]]).track_id.tolist() == [1, 2]
    assert robot.update(0.6, [2], [[3.0, 0.0]], [[0.0, 0.0]]).track_id.tolist() == [2]
    assert robot.update(9.0, [], []).track_id.tolist() == []


def test_obstacles_and_people_change_a_forecast(model):
    def path(occupancy=None, others=()):
        robot = OnlinePredictor.load(model[0])
        if occupancy is not None:
            robot.set_map(occupancy)
        position = [[0.0, 0.0], *others]
        still = [[1.0, 0.0]] + [[0.0, 0.0]] * len(others)
        return robot.update(0.0, range(len(position)), position, still).position[0]

    wall = OccupancyMap(np.ones((10, 40), bool), np.array([1.0, -2.0]), 0.1)
    assert np.abs(path(wall) - path()).max() > 1e-3
    assert np.abs(path(others=[[1.0, 0.5]]) - path()).max() > 1e-3


def test_late_and_repeated_frames_are_dropped(model):
    robot, other = OnlinePredictor.load(model[0]), OnlinePredictor.load(model[0])
    for predictor in (robot, other):
        last = predictor.update(1.0, [1], [[0.0, 0.0]])
    assert robot.update(1.0, [1], [[7.0, 0.0]]) is not last
    assert robot.update(0.5, [3], [[7.0, 0.0]]).track_id.tolist() == [1]
    a, b = (predictor.update(1.3, [1], [[0.4, 0.0]]) for predictor in (robot, other))
    np.testing.assert_array_equal(a.position, b.position)


def unpickled(robot):
    return pickle.loads(pickle.dumps(robot))  # noqa: S301 (of our own making)


@pytest.mark.parametrize("of", ["model", "mixture"])
@pytest.mark.parametrize("copied", [copy.deepcopy, unpickled])
def test_a_copy_goes_on_by_itself(copied, request, of):
    robot, ids = OnlinePredictor.load(request.getfixturevalue(of)[0]), [1, 2]
    for k in range(8):
        robot.update(0.1 * k, ids, [[0.1 * k, 0.0], [2.0, 0.1 * k]])
    other = copied(robot)
    for k in range(8, 12):
        there = [[0.1 * k, 0.0], [2.0, 0.1 * k]]
        one = robot.update(0.1 * k, ids, there)
        assert (one.position == other.update(0.1 * k, ids, there).position).all()
    robot.reset()
    assert len(other.update(1.1, [], [])) == 2  # a repeated frame
    for given in (copied(other).update(1.1, [], []), other.update(1.2, [1], [[1.2, 0.0]])):
        with pytest.raises(ValueError, match="read-only"):
            given.position[:] = 0.0


def test_a_copy_of_another_network_is_refused(model, tmp_path):
    shutil.copytree(model[0], tmp_path / "model")
    sent = pickle.dumps(OnlinePredictor.load(tmp_path / "model"))
    graph = onnx.load(tmp_path / "model" / "network.onnx")
    graph.producer_name = "another"
    onnx.save(graph, tmp_path / "model" / "network.onnx")
    with pytest.raises(InputError):
        pickle.loads(sent)  # noqa: S301 (of our own making)


def test_an_altered_model_folder_is_refused(model, tmp_path):
    whole = {name: (model[0] / name).read_bytes() for name in ("network.onnx", "model.json")}
    about = json.loads(whole["model.json"])
    altered = [about | {"schema": 99}, about | {"protocol": about["protocol"] | {"dt_s": 0.4}}]
    for field in ("tracker", "memory", "network_sha256", "description_sha256"):
        altered.append({name: value for name, value in about.items() if name != field})
    changes = [("model.json", json.dumps(plain).encode()) for plain in altered]
    for changed, raw in (*changes, ("network.onnx", whole["network.onnx"][:-7])):
        for name in whole:
            (tmp_path / name).write_bytes(raw if name == changed else whole[name])
        with unread(tmp_path / changed):
            OnlinePredictor.load(tmp_path)


def test_a_description_of_absurd_size_is_refused(model):
    about = OnlinePredictor.load(model[0]).description
    for name, value in (("dt_s", 1e-9), ("horizon_steps", 9999), ("lost_after_s", 9999.0)):
        with refused(name):
            far = replace(about.protocol, **{name: value})
            replace(about, made_with=replace(about.made_with, protocol=far))
    with refused("position_noise_m"):
        replace(about, tracker=replace(about.tracker, position_noise_m=1e300))
    with refused("memory"):
        replace(about, memory={"h": (9999, 9999)})


def test_weights_in_other_files_are_refused(model, tmp_path, monkeypatch):
    """Checksums do not cover them."""
    graph = onnx.load(model[0] / "network.onnx")
    onnx.save_model(graph, tmp_path / "network.onnx", save_as_external_data=True, location="weights.bin")
    write_description(tmp_path, OnlinePredictor.load(model[0]).description, {})
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError):
        OnlinePredictor.load(tmp_path)


def test_an_export_is_the_same_bytes_each_time_and_names_no_path(model, tmp_path):
    export(tmp_path)
    raw = (tmp_path / "network.onnx").read_bytes()
    assert raw == (model[0] / "network.onnx").read_bytes()
    assert not [place for place in (ROOT, tmp_path, torch.__path__[0]) if str(place).encode() in raw]


@pytest.mark.parametrize("page", ["README.md", "docs/index.md", "docs/robot.md"])
def test_the_example_on_a_page_runs(page, model, monkeypatch):
    """With an untrained network in place of the default one."""
    example = (ROOT / page).read_text().partition("```python\n")[2].partition("```")[0]
    monkeypatch.setattr(shipped, "_INSTALLED", model[0])
    names: dict = {}
    exec(example, names)
    assert names["forecast"].track_id.tolist() == [4, 7]


def test_newborn_people_walk_if_they_have_clearly_moved(mixture):
    """Noise of a few cm between two detections is no walking."""
    noise_m = OnlinePredictor.load(mixture[0]).description.tracker.position_noise_m
    for moved, share in ((2.4 * noise_m, 0.0), (3.75 * noise_m, 0.5), (5.1 * noise_m, 1.0)):
        place, last = np.zeros((1, 2)), np.array([[moved, 0.0]])
        belief = np.array([[0.01, 0.01, 1.0]])
        new, old = np.ones(1, bool), np.zeros(1, bool)
        assert moving_shares(place, last, new, belief, noise_m) == pytest.approx(share)
        assert moving_shares(place, last, old, belief, noise_m) == 1.0
        assert moving_shares(place, last, new, 0.0 * belief, noise_m) == 1.0  # velocities are known


def test_declared_noise_of_newborn_people_is_no_walking():
    """The shipped network: 20 people stand, detected 10 times a second with 10 cm of noise."""
    rng, robot = np.random.default_rng(3), OnlinePredictor.load(None, OnlineSettings(detection_noise_m=0.1))
    place, away_m = 5.0 * np.stack([np.arange(20) % 5, np.arange(20) // 5], axis=-1), []
    for k in range(8):
        forecast = robot.update(0.1 * k, np.arange(20), place + rng.normal(0.0, 0.1, (20, 2)))
        away_m.append(np.linalg.norm(forecast.position[:, -1] - place, axis=-1).mean())
    assert max(away_m) < 0.6


def test_shortened_paths_are_wider_by_what_they_lost():
    ahead = np.arange(1, 11)[:, None] * np.array([0.3, 0.0])
    predictions = Predictions.single(ahead[None], 0.3, np.tile(0.01 * np.eye(2), (1, 10, 1, 1)))
    short = shorten_paths(predictions, np.zeros((1, 2)), np.array([0.25]))
    np.testing.assert_allclose(short.point[0], 0.25 * ahead)
    np.testing.assert_allclose(short.covariance[0, 0, :, 0, 0], 0.01 + (0.75 * ahead[:, 0]) ** 2)
    np.testing.assert_allclose(short.covariance[0, 0, :, 1, 1], 0.01)
    same = shorten_paths(predictions, np.zeros((1, 2)), np.ones(1))
    np.testing.assert_allclose(same.path, predictions.path)
