"""The node, a publisher and a consumer as processes of their own, with real middleware.

They run on build/ros/bin/python, an environment with the ROS wheels that `make ros` makes, or on this Python
if it has rclpy. Packages without wheels are in tests/ros_packages: true names on the wire, messages as bytes.
"""

import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import contextmanager
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pedpred.ros.message_types import known_types, serialize
from pedpred.ros.planning import ROW
from pedpred.ros.scene_messages import header
from pedpred.ros2.diagnostics import DIAGNOSTICS_TYPE
from pedpred.ros2.follower import MARKERS_TYPE, PEOPLE_TYPE, TEXT_TYPE
from tests.test_ros_follower import people as people_bytes
from tests.test_ros_follower import transform as pose
from tests.test_ros_follower import transforms as transforms_bytes

ROOT = Path(__file__).parents[1]
PYTHON = ROOT / "build/ros/bin/python"
if not PYTHON.exists():
    PYTHON = Path(sys.executable) if importlib.util.find_spec("rclpy") else None
if PYTHON is None and not os.environ.get("PEDPRED_REQUIRE_ROS"):
    pytest.skip("rclpy is not installed: make ros", allow_module_level=True)

PEER, PACKAGES = ROOT / "tests/ros_packages/peer.py", ROOT / "tests/ros_packages"
CLOUD, GRID, TF = "sensor_msgs/msg/PointCloud2", "nav_msgs/msg/OccupancyGrid", "tf2_msgs/msg/TFMessage"
CLOCK, POSES = "rosgraph_msgs/msg/Clock", "geometry_msgs/msg/PoseArray"
LIMIT_S = 600
STANDING, WALKING, SPEED = np.array([3.0, 2.0, 0.0]), np.array([6.0, -1.0, 0.0]), np.array([-1.0, 0.4, 0.0])
_domains = count(20 + 10 * int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:]))


@pytest.fixture
def place(tmp_path):
    """A domain of its own, so that tests beside each other do not hear each other."""
    return Place(tmp_path, str(next(_domains)))


class Place:
    def __init__(self, folder, domain):
        self.folder, self.plans = folder, count()
        self.environment = os.environ | {
            "ROS_DOMAIN_ID": domain,
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(folder / "log"),
            "PYTHONPATH": f"{PACKAGES}:{ROOT}",
            "PYTHONUNBUFFERED": "1",
        }

    @contextmanager
    def node(self, *arguments, ready="forecasting people", number=signal.SIGTERM):
        """Run the node until the block ends, which a signal tells it; its log lines are in `told`."""
        told = self.folder / "node.txt"
        with told.open("w") as log:
            process = subprocess.Popen(
                [PYTHON, "-m", "pedpred.ros2", "--ros-args", *arguments],
                stdout=log, stderr=subprocess.STDOUT, env=self.environment, cwd=self.folder,
            )  # fmt: skip
        try:
            end_s = time.monotonic() + LIMIT_S
            while ready not in told.read_text():
                assert process.poll() is None, told.read_text()
                assert time.monotonic() < end_s, told.read_text()
                time.sleep(0.05)
            yield told
            process.send_signal(number)
            assert process.wait(LIMIT_S) == 0, told.read_text()
            assert "Traceback" not in told.read_text()
        finally:
            process.kill()
            process.wait()

    def peer(self, **plan):
        """Start a publisher or consumer, see ros_packages/peer.py; returns the process and its record."""
        path = self.folder / f"plan{next(self.plans)}.json"
        out = path.with_suffix(".txt")
        path.write_text(json.dumps({"out": str(out), "limit_s": LIMIT_S} | plan))
        out.touch()
        return subprocess.Popen([PYTHON, PEER, path], env=self.environment), out

    def exchange(self, publish, send, record, until, number, wait_for=None):
        """Publish in one process, record in another one; returns topic -> messages as they were received."""
        consumer, out = self.peer(record=record, until=until, count=number)
        publisher, _ = self.peer(publish=publish, send=send, wait_for=wait_for)
        assert publisher.wait(LIMIT_S) == 0
        assert consumer.wait(LIMIT_S) == 0
        kinds = {topic: kind for topic, kind, _ in record}
        heard = {topic: [] for topic in kinds}
        for line in out.read_text().splitlines():
            topic, _, text = line.split()
            heard[topic].append(known_types().deserialize_cdr(bytes.fromhex(text), kinds[topic]))
        return heard


def people(*told, **places):
    return people_bytes(*told, **places).hex()


def transforms(*poses):
    return transforms_bytes(*poses).hex()


def room(yaw_rad=0.0, frame="map"):
    """10 x 6 m with a wall at its left edge, turned about its corner at (-1, -3)."""
    cells = np.zeros((60, 100), np.int8)
    cells[:, :3] = 100
    turn = {"z": float(np.sin(yaw_rad / 2)), "w": float(np.cos(yaw_rad / 2))}
    origin = {"position": {"x": -1.0, "y": -3.0}, "orientation": turn}
    info = {"resolution": 0.1, "width": 100, "height": 60, "origin": origin}
    return serialize(GRID, {"header": header(0, frame), "info": info, "data": cells.ravel()}).hex()


def rows_of(cloud):
    return np.frombuffer(cloud.data.tobytes(), ROW)


CAMERA = Rotation.from_euler("xyz", [-np.pi / 2, 0.0, -np.pi / 2]), np.array([0.2, 0.1, 1.1])
ODOM = Rotation.from_euler("z", 0.7), np.array([-4.0, 1.5, 0.0])


def robot(time_s):
    return Rotation.from_euler("z", 0.4 * time_s), np.array([0.8 * time_s, 0.3 * np.sin(time_s), 0.0])


def seen(place, time_s):
    """A place of the frame odom as the camera of the robot sees it."""
    turn, offset = robot(time_s)
    return CAMERA[0].inv().apply(turn.inv().apply(place - offset) - CAMERA[1])


def test_people_of_a_robot_that_drives_and_turns(place):
    """Best effort, volatile turned map, moving frames, namespace, remap and sim time, all at once."""
    start_s, frames = 1_700_000_000.0, 30
    send = [(0.0, 2, transforms(pose("map", "odom", *ODOM), pose("base_link", "camera", *CAMERA)))]
    send.append((0.0, 3, room(0.5)))
    for k in range(-5, 2 * frames + 5):  # 20 Hz, those of a moment later than the people
        at_s = k / 20
        send.append((1.0 + at_s, 1, transforms(pose("odom", "base_link", *robot(at_s), start_s + at_s))))
    for k in range(frames):
        at_s = k / 10
        both = {"anna": seen(STANDING, at_s), "7": seen(WALKING + at_s * SPEED, at_s)}
        send.append((0.995 + at_s, 0, people(start_s + at_s, "camera", **both)))
        clock = {"clock": header(round((start_s + at_s) * 1e9), "")["stamp"]}
        send.append((1.0 + at_s, 4, serialize(CLOCK, clock).hex()))
    publish = [("/robot/detections", PEOPLE_TYPE, "bv"), ("/tf", TF, "rv"), ("/tf_static", TF, "rt")]
    publish += [("/robot/map", GRID, "rv"), ("/clock", CLOCK, "bv")]
    topics = {"predictions": CLOUD, "predictions/people": PEOPLE_TYPE, "predictions/markers": MARKERS_TYPE}
    topics |= {"predictions/names": TEXT_TYPE, "predicted_occupancy/horizon": GRID}
    record = [(f"/robot/{topic}", kind, "rt") for topic, kind in topics.items()]
    arguments = ["-r", "__ns:=/robot", "-r", "people:=detections", "-p", "use_sim_time:=true"]
    arguments += ["-p", "occupancy_cell_m:=0.5"]
    arguments += ["-p", "transform_timeout_s:=60.0"]  # a busy machine may be slow to publish them
    with place.node(*arguments) as told:
        sent = sorted(send, key=lambda one: one[0])
        until = "/robot/predictions"
        heard = place.exchange(publish, sent, record, until, frames, ("/robot/detections", 1))
    assert "map of " in told.read_text()
    assert "no map has come" not in told.read_text()
    clouds = heard["/robot/predictions"]
    stamps = [cloud.header.stamp.sec + cloud.header.stamp.nanosec / 1e9 for cloud in clouds]
    np.testing.assert_allclose(stamps, start_s + np.arange(frames) / 10, atol=1e-6)
    assert {cloud.header.frame_id for cloud in clouds} == {"map"}
    assert {field.datatype for field in clouds[0].fields if field.name in ("x", "y", "z")} == {7}
    there = ODOM[0].apply(STANDING) + ODOM[1]
    for message in heard["/robot/predictions/people"][-10:]:
        anna = next(one for one in message.people if one.name == "anna")
        assert np.hypot(anna.velocity.x, anna.velocity.y) < 0.05
        assert np.hypot(anna.position.x - there[0], anna.position.y - there[1]) < 0.1
    last = heard["/robot/predictions/people"][-1]
    walker = next(one for one in last.people if one.name == "7")
    np.testing.assert_allclose([walker.velocity.x, walker.velocity.y], ODOM[0].apply(SPEED)[:2], atol=0.3)
    (names,) = heard["/robot/predictions/names"]
    (number,) = json.loads(names.data)
    rows = rows_of(clouds[-1])
    assert int(number) in rows["track_high"].astype(np.int64) * 2**32 + rows["track_id"]
    texts = {one.text for one in heard["/robot/predictions/markers"][-1].markers if one.type == 9}
    assert texts == {"anna", "7"}
    assert max(heard["/robot/predicted_occupancy/horizon"][-1].data) > 0


def test_a_latched_map_of_before_is_used_and_diagnostics_say_so(place):
    mapper, _ = place.peer(publish=[("/map", GRID, "rt")], send=[(0.0, 0, room())], until="/end", count=1)
    walk = [(k / 10, 0, people(100.0 + k / 10, ada=(k / 10, 0.0))) for k in range(25)]
    record = [("/predictions", CLOUD, "rv"), ("/diagnostics", DIAGNOSTICS_TYPE, "rv")]
    with place.node() as told:
        heard = place.exchange(
            [("/people", PEOPLE_TYPE, "rv")], walk, record, "/predictions", 25, ("/people", 1)
        )
    mapper.kill()
    mapper.wait()
    assert "no map has come" not in told.read_text()
    statuses = [status for message in heard["/diagnostics"] for status in message.status]
    assert {(status.level, status.message) for status in statuses} & {(0, "forecasts with map")}
    values = {pair.key: pair.value for pair in statuses[-1].values}
    assert values["map"] == "100 x 60 cells"


def test_without_a_map_everybody_is_told(place):
    """And a second publisher whose time begins again goes on; Ctrl-C ends the node without a traceback."""
    walk = [(k / 10, 0, people(100.0 + k / 10, **{"5": (k / 10, 0.0)})) for k in range(25)]
    record = [("/predictions", CLOUD, "rv"), ("/diagnostics", DIAGNOSTICS_TYPE, "rv")]
    publish = [("/people", PEOPLE_TYPE, "bv")]
    with place.node(number=signal.SIGINT) as told:
        for _ in range(2):
            heard = place.exchange(publish, walk, record, "/predictions", 25, ("/people", 1))
            times = [cloud.header.stamp.sec for cloud in heard["/predictions"]]
            assert times[0] == 100
            assert times == sorted(times)
    text = told.read_text()
    assert "no map has come: forecasts go through walls" in text
    assert "all are forgotten" in text  # when time began again
    statuses = [status for message in heard["/diagnostics"] for status in message.status]
    assert any("no map: forecasts go through walls" in one.message and one.level == 1 for one in statuses)


def test_what_is_missing_between_frames_is_said_and_not_repeated(place):
    walk = [(k / 20, 0, people(100.0 + k / 20, "camera", **{"5": (k / 20, 0.0)})) for k in range(40)]
    record = [("/diagnostics", DIAGNOSTICS_TYPE, "rv")]
    with place.node("-p", "use_map:=false") as told:
        place.exchange([("/people", PEOPLE_TYPE, "rv")], walk, record, "/diagnostics", 4, ("/people", 1))
    lines = [line for line in told.read_text().splitlines() if "left out" in line]
    assert "no /tf leads from 'camera' to 'map': 'camera' has no parent and 'map' has no parent" in lines[0]
    assert len(lines) <= 3


def test_people_without_ids_are_told_apart(place):
    send = []
    for k in range(20):
        places = [(0.1 * k, 0.0), (4.0 - 0.1 * k, 1.0)]
        poses = [
            {"position": {"x": x, "y": y}, "orientation": {"w": 1.0}} for x, y in places[:: 1 - 2 * (k % 2)]
        ]
        content = {"header": header(100 * 10**9 + k * 10**8, "map"), "poses": poses}
        send.append((k / 10, 0, serialize(POSES, content).hex()))
    with place.node("-p", "use_map:=false", "-p", f"people_type:={POSES}") as told:
        heard = place.exchange(
            [("/people", POSES, "bv")],
            send,
            [("/predictions", CLOUD, "rv")],
            "/predictions",
            20,
            ("/people", 1),
        )
    assert "people have no ids that say who is who" in told.read_text()
    tracks = Counter(
        track for cloud in heard["/predictions"] for track in np.unique(rows_of(cloud)["track_id"])
    )
    assert tracks == {1: 20, 2: 20}


def test_a_manager_starts_the_node(place):
    """It makes no publisher before it is configured, and forecasts nobody before it is active."""
    walk = [(k / 10, 0, people(100.0 + k / 10, **{"5": (k / 10, 0.0)})) for k in range(5)]
    arguments = ("-p", "autostart:=false", "-p", "use_map:=false", "--log-level", "pedpred:=debug")
    manager, out = place.peer(transitions=["configure", "activate"], node="/pedpred")
    with place.node(*arguments) as told:
        assert manager.wait(LIMIT_S) == 0
        assert out.read_text().split() == ["configure", "True", "activate", "True"]
        publish, record = [("/people", PEOPLE_TYPE, "rv")], [("/predictions", CLOUD, "rv")]
        place.exchange(publish, walk, record, "/predictions", 5, ("/people", 1))
    assert "forecasting people of /people" in told.read_text()


def test_a_node_that_still_compiles_ends_when_it_is_told_to(place):
    place.environment["NUMBA_CACHE_DIR"] = str(place.folder)
    with place.node(ready="compiling what is not compiled yet"):
        pass


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("-r", "map:=/local_costmap/costmap"), "costs are no map"),
        (
            ("-p", "people_type:=spencer_tracking_msgs/msg/TrackedPersons"),
            "spencer_tracking_msgs is not installed",
        ),
        (("-p", "identities:=guessed"), "identities = 'guessed', but it must be one of"),
    ],
)
def test_a_start_that_cannot_succeed_says_why(place, arguments, problem):
    command = [PYTHON, "-m", "pedpred.ros2", "--ros-args", *arguments]
    done = subprocess.run(
        command, env=place.environment, cwd=place.folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert problem in done.stdout + done.stderr
