"""The node, a publisher and a consumer as processes of their own, with real middleware.

They run on build/ros/bin/python, an environment with the ROS wheels that `make ros` makes, or on this Python
if it has rclpy. Packages without wheels are in tests/ros_packages: true names on the wire, messages as bytes.
"""

import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from pedpred.ros.message_types import UPDATE_TYPE, serialize
from pedpred.ros.planning import ROW
from pedpred.ros.scene_messages import header, seconds
from pedpred.ros2.diagnostics import DIAGNOSTICS_TYPE
from pedpred.ros2.outputs import MARKERS_TYPE, PEOPLE_TYPE, TEXT_TYPE
from tests.bags import GRID, TF
from tests.conftest import ROOT, with_ros
from tests.following import grid
from tests.following import people as people_bytes
from tests.following import transform as pose
from tests.following import transforms as transforms_bytes
from tests.robots import CAMERA, ODOM, SPEED, STANDING, WALKING, from_camera, robot
from tests.ros_place import CLOUD, LIMIT_S, NODE, PYTHON, Place

pytestmark = with_ros
AGENTS = "pedsim_msgs/msg/AgentStates"
CLOCK = "rosgraph_msgs/msg/Clock"
PEOPLE = "/people", PEOPLE_TYPE, "rv"
ANSWERS = ("/predictions", CLOUD, "rv"), ("/diagnostics", DIAGNOSTICS_TYPE, "rv")
COMPILING_S = 600
_domains = count(20 + 30 * int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:]))


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """What the node compiles is in the cache, so that it starts within the limit of a wait."""
    if Path(sys.executable) == PYTHON:
        assert importlib.util.find_spec("rclpy"), "rclpy is not installed: make ros"
    log = tmp_path_factory.mktemp("compiled") / "log.txt"
    with log.open("w") as out:
        command = [PYTHON, "-m", "pedpred.command", "warm-up"]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            command, stdout=out, stderr=out, env=environment, timeout=COMPILING_S, check=False
        )
    assert done.returncode == 0, log.read_text()


@pytest.fixture
def place(tmp_path, compiled):
    """A domain of its own, so that tests beside each other do not hear each other."""
    here = Place(tmp_path, str(next(_domains)))
    yield here
    here.close()


def people(*about, **places):
    return people_bytes(*about, **places).hex()


def transforms(*poses):
    return transforms_bytes(*poses).hex()


def clock(time_s):
    return serialize(CLOCK, {"clock": header(round(time_s * 1e9), "")["stamp"]}).hex()


def room(yaw_rad=0.0, frame="map"):
    """10 x 6 m with a wall at its left edge, turned about its corner at (-1, -3)."""
    cells = np.zeros((60, 100), np.int8)
    cells[:, :3] = 100
    return grid(cells, yaw_rad, frame, resolution=0.1, position={"x": -1.0, "y": -3.0}).hex()


def rows_of(cloud):
    return np.frombuffer(cloud.data.tobytes(), ROW)


def test_people_of_a_robot_that_drives_and_turns(place):
    """Best effort, volatile turned map, moving frames, namespace, remap, sim time, all at once; then again.

    The second time is as when a bag is played again: another publisher, and all clocks go back.
    """
    start_s, frames = 1_700_000_000.0, 30
    fixed = transforms(pose("map", "odom", *ODOM), pose("base_link", "camera", *CAMERA))
    probe, beat = [(4, clock(start_s)), (2, fixed), (3, room(0.5))], (0, people(start_s - 40, "camera"))
    send = [(0.0, 2, fixed), (0.0, 3, room(0.5))]
    for k in range(-5, 2 * frames + 5):  # 20 Hz, those of a moment later than the people
        at_s = k / 20
        send.append((1.0 + at_s, 1, transforms(pose("odom", "base_link", *robot(at_s), start_s + at_s))))
    for k in range(frames):
        at_s = k / 10
        both = {"anna": from_camera(STANDING, at_s), "7": from_camera(WALKING + at_s * SPEED, at_s)}
        send.append((0.995 + at_s, 0, people(start_s + at_s, "camera", **both)))
        send.append((1.0 + at_s, 4, clock(start_s + at_s)))
    publish = [("/robot/detections", PEOPLE_TYPE, "bv"), ("/tf", TF, "rv"), ("/tf_static", TF, "rt")]
    publish += [("/robot/map", GRID, "rv"), ("/clock", CLOCK, "bv")]
    topics = {"predictions": CLOUD, "predictions/people": PEOPLE_TYPE, "predictions/markers": MARKERS_TYPE}
    topics |= {"predictions/names": TEXT_TYPE, "predicted_occupancy/horizon": GRID}
    latched, volatile = (
        [(f"/robot/{topic}", kind, qos) for topic, kind in topics.items()]
        + [("/diagnostics", DIAGNOSTICS_TYPE, "rv")]
        for qos in ("rt", "rv")
    )
    arguments = ["-r", "__ns:=/robot", "-r", "people:=detections", "-p", "use_sim_time:=true"]
    arguments += ["-p", "occupancy_cell_m:=0.5"]
    arguments += ["-p", "transform_timeout_s:=60.0"]  # a busy machine may be slow to publish them
    with place.node(*arguments) as log:
        sent = sorted(send, key=lambda one: one[0])
        until = {"/robot/predictions": frames, "/diagnostics": 2}
        received = place.exchange(publish, beat, sent, latched, until, probe, start_s)
        again = place.exchange(publish, beat, sent, volatile, until, probe, start_s)
    assert "'base_link' go back" in log.read_text()
    check_walks(again, start_s, frames)
    check_walks(received, start_s, frames)
    rows = rows_of(received["/robot/predictions"][-1])
    (names,) = received["/robot/predictions/names"]
    (number,) = json.loads(names.data)
    assert int(number) in rows["track_high"].astype(np.int64) * 2**32 + rows["track_id"]
    assert start_s <= seconds(received["/diagnostics"][-1].header.stamp) < start_s + frames / 10
    texts = {one.text for one in received["/robot/predictions/markers"][-1].markers if one.type == 9}
    assert texts == {"anna", "7"}
    assert max(received["/robot/predicted_occupancy/horizon"][-1].data) > 0


def check_walks(received, start_s, frames):
    """Every frame is forecast once, in the frame of the map; who stands is slower than 0.05 m/s."""
    clouds = received["/robot/predictions"]
    stamps = [seconds(cloud.header.stamp) for cloud in clouds]
    np.testing.assert_allclose(stamps, start_s + np.arange(frames) / 10, atol=1e-6)
    assert {cloud.header.frame_id for cloud in clouds} == {"map"}
    assert {field.datatype for field in clouds[0].fields if field.name in ("x", "y", "z")} == {7}
    there = ODOM[0].apply(STANDING) + ODOM[1]
    for message in received["/robot/predictions/people"][-10:]:
        anna = next(one for one in message.people if one.name == "anna")
        assert np.hypot(anna.velocity.x, anna.velocity.y) < 0.05
        assert np.hypot(anna.position.x - there[0], anna.position.y - there[1]) < 0.1
    last = received["/robot/predictions/people"][-1]
    walker = next(one for one in last.people if one.name == "7")
    np.testing.assert_allclose([walker.velocity.x, walker.velocity.y], ODOM[0].apply(SPEED)[:2], atol=0.3)


def test_a_latched_map_of_before_is_used_and_updates_change_it(place):
    """As diagnostics say: before the node starts a map is published, and later a part of it changes."""
    sent = place.folder / "sent"
    place.peer(publish=[("/map", GRID, "rt")], send=[(0.0, 0, room())], sent=str(sent), done="never")
    place.wait(sent.exists, "a published map")
    update = {"header": header(0), "x": 3, "width": 3, "height": 60, "data": np.full(180, 100, np.int8)}
    send = [(k / 10, 0, people(100.0 + k / 10, ada=(k / 10, 0.0))) for k in range(25)]
    send.append((2.5, 1, serialize(UPDATE_TYPE, update).hex()))
    publish, until = [PEOPLE, ("/map_updates", UPDATE_TYPE, "rv")], {"/predictions": 25, "/diagnostics": 5}
    with place.node(ready="map of "):
        received = place.exchange(publish, (0, people(60.0)), send, ANSWERS, until)
    statuses = [status for message in received["/diagnostics"] for status in message.status]
    assert {(status.level, status.message) for status in statuses} & {(0, "forecasts with map")}
    maps = [pair.value for status in statuses for pair in status.values if pair.key == "map"]
    assert maps[0] == "100 x 60 cells, 3.0 % blocked"
    assert maps[-1] == "100 x 60 cells, 6.0 % blocked"


def test_other_qos_and_another_node_are_warned_about(place):
    """Transforms are best effort, fixed ones volatile; one of the map's two subscriptions hears it."""
    other = place.folder / "other.txt"
    place.start((*NODE, "--ros-args", "-p", "use_map:=false"), other)
    place.wait(lambda: "forecasting people" in other.read_text(), "another node", other)
    deaf = [("/tf", TF, "bv"), ("/tf_static", TF, "rv")]
    deaf += [("/map", GRID, "bv"), ("/map_updates", UPDATE_TYPE, "bv")]
    place.peer(publish=deaf, send=[], done="never")
    send = [(k / 10, 0, people(100.0 + k / 10, ada=(0.0, 0.0))) for k in range(5)]
    with place.node("-p", "use_sim_time:=true") as log:
        received = place.exchange([PEOPLE], (0, people(60.0)), send, ANSWERS, {"/diagnostics": 6})
        place.wait(lambda: log.read_text().count("offering incompatible QoS") > 2, "warnings", log)
    lines = [line for line in log.read_text().splitlines() if "offering incompatible QoS" in line]
    topics = {"/" + line.partition("topic '")[2].partition("'")[0].lstrip("/") for line in lines}
    assert topics == {"/tf", "/tf_static", "/map_updates"}
    texts = [one.status[0].message for one in received["/diagnostics"]]
    assert any("use_sim_time" in text for text in texts)
    assert any("another node publishes" in text for text in texts)


def test_no_message_ends_or_stalls_the_node(place):
    """Wrong ones on all topics, again and again, then people, who are forecast; few errors are logged."""
    crowd = people(50.0, **{str(k): (k % 100, k // 100) for k in range(5000)})
    nowhere = serialize(GRID, {"info": {"width": 1, "height": 1, "resolution": 0.1}}).hex()
    loop = transforms(*(pose(*edge, *CAMERA, 50.0) for edge in (("a", "b"), ("b", "a"))))
    cut = people(50.0, ada=(1.0, 1.0))[:-20]
    odd = [(0, crowd), (0, cut), (0, "00010000"), (0, people(50.0, "a", ada=(1.0, 1.0))), (1, nowhere)]
    odd += [(1, room()[:-2]), (2, loop), (2, "00010000ffffffff"), (0, people(50.0, ada=(np.nan, np.inf)))]
    odd.append((0, people(70.0, **{"9" * 5000: (1e8, -1e8)})))
    send = [(0.3 * k, *one) for k in range(10) for one in odd]
    send += [(3.0 + k / 10, 0, people(100.0 + k / 10, ada=(k / 10, 0.0))) for k in range(20)]
    publish = [PEOPLE, ("/map", GRID, "rv"), ("/tf", TF, "rv")]
    with place.node() as log:
        until = {"/predictions": 20, "/diagnostics": 6}
        received = place.exchange(publish, (0, people(20.0)), send, ANSWERS, until)
    assert [rows_of(cloud)["x"].size > 0 for cloud in received["/predictions"]] == [True] * 20
    lines = [line for line in log.read_text().splitlines() if "left out" in line]
    for text in ("most_people", "people_msgs/msg/People", "'a'"):
        assert any(text in line for line in lines), text
    assert len(lines) < len(send) / 4
    (table,) = ({pair.key: pair.value for pair in one.values} for one in received["/diagnostics"][-1].status)
    assert int(table["left out: people without a forecast"]) > 0


def test_the_node_ends_well_at_any_moment(place):
    """Many times, at work and while it starts, since what it does when the signal comes is left to chance."""
    crowd = people(100.0, **{str(k): (k % 20, k // 20) for k in range(200)})
    never = {name: str(place.folder / "never") for name in ("ready", "done")}
    place.peer(publish=[PEOPLE], probe=[], beat=(0, crowd), send=[], **never)
    for k in range(12):
        ready, wait_s = ("compiling what", 0.3 * k) if k < 6 else ("forecasting people", 1.0 + k / 60)
        with place.node("-p", "use_map:=false", ready=ready, number=(signal.SIGTERM, signal.SIGINT)[k % 2]):
            time.sleep(wait_s)


def test_a_manager_starts_the_node(place):
    """In whatever order it asks; the node listens to agents of a simulator only when it is active."""

    def agents(*k):
        moved = [{"id": 5, "type": 1, "pose": {"position": {"x": one / 10}}} for one in k]
        stamp = header(100 * 10**9 + sum(k) * 10**8 - (not k) * 40 * 10**9, "map")
        return serialize(AGENTS, {"header": stamp, "agent_states": moved}).hex()

    walk = [(k / 10, 0, agents(k)) for k in range(5)]
    arguments = ["-p", f"people_type:={AGENTS}", "-p", "autostart:=false", "-p", "use_map:=false"]
    arguments += ["--log-level", "pedpred:=debug"]
    asked = [("activate", False), ("configure", True), ("cleanup", True), ("configure", True)]
    asked += [("activate", True), ("cleanup", False), ("deactivate", True), ("activate", True)]
    manager, out, peer_log = place.peer(transitions=[label for label, _ in asked], node="/pedpred")
    with place.node(*arguments) as log:
        assert manager.wait(2 * LIMIT_S) == 0, peer_log.read_text()
        assert out.read_text().splitlines() == [f"{label} {is_done}" for label, is_done in asked]
        publish = [("/people", AGENTS, "rv")]
        received = place.exchange(publish, (0, agents()), walk, ANSWERS[:1], {"/predictions": 5})
    assert all(set(rows_of(cloud)["track_id"]) == {5} for cloud in received["/predictions"])
    assert "forecasting people of /people" in log.read_text()


def test_what_colcon_installs_starts_the_node(place):
    """The index of packages finds it; parameters of its file that another argument does not change count."""
    source, installed = place.folder / "src/pedpred_ros", place.folder / "install/pedpred_ros"
    shutil.copytree(ROOT / "ros/pedpred_ros", source)
    done = place.run([PYTHON.parent / "colcon", "build", "--packages-select", "pedpred_ros"])
    assert done.returncode == 0, done.stdout + done.stderr
    script = "from ament_index_python.packages import get_package_share_directory as found; "
    command = [PYTHON, "-c", script + "print(found('pedpred_ros'))"]
    share = Path(place.run(command, AMENT_PREFIX_PATH=str(installed)).stdout.strip())
    assert share == installed / "share/pedpred_ros"
    there = {str(path.relative_to(share)) for path in share.rglob("*.*")}
    assert {"launch/pedpred.launch.py", "rviz/pedpred.rviz", "config/nav2_people_layer.yaml"} <= there
    (packages,) = installed.glob("lib/python*/site-packages")
    place.environment["PYTHONPATH"] += f":{packages}"
    arguments = ["--params-file", str(share / "config/pedpred.yaml")]
    sent = place.folder / "sent"
    place.peer(publish=[("/map", GRID, "rt")], send=[(0.0, 0, room())], sent=str(sent), done="never")
    place.wait(sent.exists, "a published map")
    command = (PYTHON, installed / "lib/pedpred_ros/pedpred")
    record = [("/predicted_occupancy/horizon", GRID, "rt"), ANSWERS[0]]
    walk = [(k / 10, 0, people(100.0 + k / 10, ada=(k / 10, 0.0))) for k in range(5)]
    with place.node(*arguments, command=command, ready="map of "):
        until = {"/predictions": 5, "/predicted_occupancy/horizon": 1}
        received = place.exchange([PEOPLE], (0, people(60.0)), walk, record, until)
    side_m = received["/predicted_occupancy/horizon"][-1].info.resolution
    assert side_m == pytest.approx(0.1)  # the parameter of the file: otherwise there is no grid


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("-r", "map:=/local_costmap/costmap"), "use_map"),
        (("-p", "people_type:=spencer_tracking_msgs/msg/TrackedPersons"), "apt install"),
        (("-p", "use_map:=maybe"), "use_map"),
        (("--params-file", "missing.yaml"), "missing.yaml"),
        (("-p", "occupancy_cell:=0.1", "-p", "use_map:=1"), "occupancy_cell"),
        (("-r", "people:=/predictions/people"), "'people'"),
    ],
)
def test_a_start_that_cannot_succeed_names_the_argument(place, arguments, named):
    done = place.run([*NODE, "--ros-args", *arguments])
    assert done.returncode == 1
    assert named in done.stdout + done.stderr


def test_what_was_learned_is_kept_for_the_next_start(place):
    path = place.folder / "hall.json"
    with place.node("-p", f"place_file:={path}") as log:
        assert str(path) not in log.read_text()
    written = path.read_bytes()
    with place.node("-p", f"place_file:={path}", "-p", "transform_timeout_s:=1") as log:  # a whole number
        assert str(path) in log.read_text()
    assert path.read_bytes() == written
