"""What was learned at a place, kept in a file: a robot that starts again forecasts as if it had gone on."""

import copy
import json
import os

import numpy as np
import pytest

from pedpred.errors import OutputError
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.network import digest_of
from tests.refused import unread
from tests.worlds import walled_scene


@pytest.fixture(scope="module")
def people():
    """Of a place with walls, for 12 s: times [T], ids, positions of each frame."""
    scene = walled_scene(np.random.default_rng(10), 0.1, detections=120, tracks=5)
    tracks = scene.trajectories
    instants = np.unique(tracks.time_s)
    return [
        (now, tracks.track_id[tracks.time_s == now], tracks.position[tracks.time_s == now])
        for now in instants
    ]


def stream(robot, people, since_s=0.0):
    """The forecasts of a visit."""
    return [robot.update(since_s + now, ids, position) for now, ids, position in people]


@pytest.fixture(scope="module")
def visitor(mixture, people):
    robot = OnlinePredictor.load(mixture[0])
    stream(robot, people)
    return robot


@pytest.fixture
def visited(visitor):
    """A robot that has seen people, who have left."""
    return copy.deepcopy(visitor)


def test_a_robot_that_starts_again_goes_on(mixture, people, visited, tmp_path):
    path = tmp_path / "hall.json"
    visited.save_place(path)
    new, untaught = OnlinePredictor.load(mixture[0]), OnlinePredictor.load(mixture[0])
    new.load_place(path)
    visits = [stream(robot, people, 100.0) for robot in (visited, new, untaught)]
    for expected, found in zip(*visits[:2], strict=True):
        np.testing.assert_array_equal(found.predictions.path, expected.predictions.path)
        np.testing.assert_array_equal(found.covariance, expected.covariance)
    apart = [np.abs(a.predictions.path - b.predictions.path).max() for a, b in zip(*visits[1:], strict=True)]
    assert max(apart) > 0.01


def test_loading_forgets_the_people(visited, tmp_path):
    for name in ("hall.json", "again.json"):
        visited.save_place(tmp_path / name)
        visited.load_place(tmp_path / name)
        assert len(visited.update(0.0, [], np.zeros((0, 2)))) == 0
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "hall.json").read_bytes()


def test_without_trust_a_robot_takes_regions_and_keeps_trust(mixture, visited, tmp_path):
    """What is not used stays in the file."""
    path = tmp_path / "hall.json"
    visited.save_place(path)
    learned = json.loads(path.read_text())["trust"]
    assert np.any(learned["compared"])
    alone = OnlinePredictor.load(mixture[0], OnlineSettings(learn_trust=False))
    for _ in range(2):
        alone.load_place(path)
        regions = np.clip(visited._place.regions.learned, *alone._place.regions.limits)
        np.testing.assert_array_equal(alone._place.regions.learned, regions)
        alone.save_place(path)
        assert json.loads(path.read_text())["trust"] == learned
    again = OnlinePredictor.load(mixture[0])
    again.load_place(path)
    np.testing.assert_array_equal(again._place.trust.place.compared, learned["compared"])


@pytest.mark.parametrize(
    ("where", "value"),
    [
        (("schema",), 1),
        (("network_sha256",), "0" * 64),
        (("regions", "learned", 0, 0, 0), 1.5),
        (("trust", "compared", 0), -1.0),
        (("local_errors", "square", 0, 0), -1.0),
        (("local_errors", "error", 0, 0), [1.0]),
    ],
)
def test_a_wrong_file_is_refused_and_nothing_changes(where, value, people, visited, tmp_path):
    """Its checksum is right."""
    path = tmp_path / "hall.json"
    visited.save_place(path)
    intact = path.read_text()
    about = part = json.loads(intact)
    *way, last = where
    for key in way:
        part = part[key]
    part[last] = value
    about.pop("sha256")
    path.write_text(json.dumps(about | {"sha256": digest_of(about)}))
    with unread(path):
        visited.load_place(path)
    visited.save_place(path)
    assert path.read_text() == intact
    last_s, ids, position = people[-1]
    assert len(visited.update(last_s + 0.1, ids, position)) > len(ids)  # somebody else is still known


def test_nothing_is_left_behind_where_no_file_can_be(mixture, tmp_path):
    """What is no file stays, such as a device: a root's robot replaced /dev/null."""
    robot = OnlinePredictor.load(mixture[0])
    (tmp_path / "file").touch()
    os.mkfifo(tmp_path / "pipe")
    for name in ("", "pipe", "file/hall.json", "a" * 300):
        with pytest.raises(OutputError):
            robot.save_place(tmp_path / name)
    assert (tmp_path / "pipe").is_fifo()
    assert {path.name for path in tmp_path.iterdir()} == {"file", "pipe"}
