"""People in frames that move: brought into the map's frame with the transforms of the bag."""

from contextlib import suppress

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg
from scipy.spatial.transform import Rotation

from pedpred.command import main
from pedpred.errors import InputError
from pedpred.online import OnlinePredictor
from pedpred.online.replay import replay_scene
from pedpred.ros import Transform, read_bag
from pedpred.storage.scenes import read_scene
from tests.bags import TF, Store, bag, check_moving, moving_bag, moving_messages, transform, write_timed
from tests.robots import ODOM, SPEED, STANDING, WALKING, from_camera, from_robot, robot


@pytest.mark.parametrize(
    ("frame", "seen"), [("base_link", from_robot), ("camera", from_camera), ("/base_link", from_robot)]
)
def test_who_stands_before_a_moving_robot_stands(frame, seen, ros2, tmp_path):
    """Also by the forecasts: slower than 0.05 m/s, as live (`test_ros_node.py`)."""
    scene = read_bag(moving_bag(ros2, tmp_path / "hall", frame, seen))
    check_moving(scene)
    for forecast in replay_scene(scene, OnlinePredictor.load()):
        assert np.linalg.norm(forecast.velocity[forecast.track_id == 1][:, 0], axis=-1).max() < 0.05


def test_people_come_into_the_frame_of_the_map(ros2, tmp_path):
    check_moving(read_bag(moving_bag(ros2, tmp_path / "hall", localised=True, grid="map")), ODOM)
    check_moving(read_bag(moving_bag(ros2, tmp_path / "bare", localised=True)), ODOM)
    check_moving(read_bag(moving_bag(ros2, tmp_path / "odom", localised=True, grid="odom")))


@pytest.mark.parametrize(
    ("jumps", "jump_m", "jump_rad"), [(0, 0.0, 0.0), (1, 0.6, 0.05), (1, 3.0, 0.3), (8, 0.1, 0.02)]
)
def test_nobody_moves_because_the_localisation_jumps(ros2, tmp_path, caplog, jumps, jump_m, jump_rad):
    """As live (`test_ros_follower.py`): places lead to where the localisation has people in the end."""
    found = moving_messages(ros2)
    for time_s in 9.98 + np.arange(0, 5.2, 0.05):
        so_far = (np.linspace(12.5, 14.4, jumps) < time_s).sum()
        lies = Rotation.from_euler("z", jump_rad * so_far), np.array([jump_m * so_far, 0.0, 0.0])
        found.append((time_s, "/tf", TF, transform(ros2, "map", "odom", lies, time_s)))
    scene = read_bag(write_timed(ros2, tmp_path / "hall", sorted(found, key=lambda one: one[0])))
    tracks = scene.trajectories
    for who, at in ((1, STANDING), (2, WALKING + 14.9 * SPEED)):
        place = tracks.position[tracks.track_id == who]
        np.testing.assert_allclose(place[-1], (lies[0].apply(at) + lies[1])[:2], atol=0.02)
        speed_mps = np.hypot(*(np.diff(place, axis=0) / 0.1).T)
        true_mps = np.hypot(*SPEED[:2]) * (who - 1)
        assert np.abs(speed_mps - true_mps).max() < (0.35 if jumps else 1e-3)
        assert np.median(np.abs(speed_mps - true_mps)) < 0.25
    assert ("the localisation has moved 'odom' in 'map'" in caplog.text) == (jumps > 0)


def test_bags_of_ros_1_have_transforms_too(tmp_path):
    store = Store(Stores.ROS1_NOETIC)
    store.types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))
    check_moving(read_bag(moving_bag(store, tmp_path / "hall.bag")))


def test_people_in_a_fixed_frame_stay_where_they_are(ros2, tmp_path):
    found = moving_messages(ros2, "map", lambda at, _: at, localised=True, grid="map")
    check_moving(read_bag(write_timed(ros2, tmp_path / "hall", found)), atol=1e-9)


def test_a_frame_that_nothing_leads_to_is_named_with_what_to_record(ros2, tmp_path):
    path = moving_bag(ros2, tmp_path / "hall", grid="map")
    with pytest.raises(
        InputError, match=r"'base_link', which /tf brings to 'odom', map in 'map'.*record /tf"
    ) as told:
        read_bag(path)
    assert "transform" not in str(told.value)
    check_moving(read_bag(path, map_topic=""))
    main(["convert", str(path), "-o", str(tmp_path / "scene"), "--map-topic", ""])
    check_moving(read_scene(tmp_path / "scene"))


def test_a_given_transform_is_that_of_the_frame_that_stands(ros2, tmp_path):
    """A fixed pose of a robot's frame would be wrong; where /tf reaches the map there is nothing to give."""
    given, pose = Transform(-4.0, 1.5, 0.7), ODOM
    check_moving(read_bag(moving_bag(ros2, tmp_path / "hall", grid="map"), transform=given), pose)
    with pytest.raises(InputError, match=r"'base_link' moves.*leave --transform out"):
        read_bag(moving_bag(ros2, tmp_path / "all", localised=True, grid="map"), transform=given)


def test_detections_without_a_transform_at_their_time_are_left_out(ros2, tmp_path, caplog):
    """Before the first one, after the last one, and where they stop for more than a second."""
    tf_s = np.r_[np.arange(1.0, 2.01, 0.05), np.arange(3.5, 4.51, 0.05)]
    scene = read_bag(moving_bag(ros2, tmp_path / "hall", tf_s=tf_s))
    check_moving(scene)
    here = np.unique(scene.trajectories.time_s) - 10.0
    assert here.min() == pytest.approx(1.0)
    assert here.max() == pytest.approx(4.5)
    assert not ((here > 2.05) & (here < 3.45)).any()
    assert f"{100 - 2 * len(here)} of 100 detections" in caplog.text
    with pytest.raises(InputError, match=r"transform = .none at 10\.0 s.*record both together"):
        read_bag(moving_bag(ros2, tmp_path / "late", tf_s=tf_s + 100.0))


def test_who_has_no_height_is_left_out_where_the_frame_is_tilted_and_nowhere_else(ros2, tmp_path, caplog):
    def flat(seen):
        return lambda at, time_s: seen(at, time_s) * [1.0, 1.0, np.nan if time_s >= 12.0 else 1.0]

    check_moving(read_bag(moving_bag(ros2, tmp_path / "level", "base_link", flat(from_robot))))
    assert "left out" not in caplog.text
    scene = read_bag(moving_bag(ros2, tmp_path / "tilted", "camera", flat(from_camera)))
    check_moving(scene)
    assert scene.trajectories.time_s.max() < 12.0
    assert "60 detections without a height in 'camera', which is tilted" in caplog.text


@pytest.mark.parametrize(
    ("frame", "moves"),
    [
        *((name, True) for name in ("base_link", "laser", "robot1/velodyne", "camera_depth_optical_frame")),
        *((name, False) for name in ("odom", "hall")),
    ],
)
def test_a_robots_or_sensors_frame_without_transforms_is_warned_about(frame, moves, ros2, tmp_path, caplog):
    read_bag(moving_bag(ros2, tmp_path / "hall", frame, tf_s=np.zeros(0)))
    said = f"people are in '{frame}', and nothing says how that moves"
    assert (said in caplog.text, "nothing says" in caplog.text) == (moves, moves)


def test_damaged_transforms_and_maps_are_left_out_and_counted(ros2, tmp_path, caplog):
    """Of a bag without compression, whose messages are in it as they were sent."""
    found = moving_messages(ros2, localised=True, grid="map")
    grid = next(one for _, topic, *one in found if topic == "/map")
    found.append((20.0, "/map", *grid))
    path = write_timed(ros2, tmp_path / "hall", found)
    (base,) = path.glob("*.db3")
    raw, sent = base.read_bytes(), [one for _, topic, *one in found if topic == "/tf"][40]
    for kind, message in (sent, grid):
        packed = bytes(ros2.types.serialize_cdr(message, kind))
        at = raw.rindex(packed)
        raw = raw[:at] + bytes([255]) * len(packed) + raw[at + len(packed) :]
    base.write_bytes(raw)
    check_moving(read_bag(path), ODOM, atol=0.01)
    assert "of 2 messages, which are damaged (/map: " in caplog.text
    assert "which are damaged (/tf: " in caplog.text


def test_people_without_a_frame_are_told(ros2, tmp_path, caplog):
    steps = [(k / 10, {"1": (k / 10, 0.0)}) for k in range(20)]
    read_bag(bag(ros2, tmp_path / "hall", *steps, frame="", grid=False))
    assert "/people: 20 of 20 messages name no frame (header.frame_id is empty)" in caplog.text


def test_a_frame_whose_y_is_a_height_is_refused(ros2, tmp_path):
    """A camera's, or that of a simulator whose y is up: z is the way of people, too."""
    found = moving_messages(ros2, "world", lambda at, _: at[[0, 2, 1]] + [0.0, 0.0, 0.0], tf_s=np.zeros(0))
    with pytest.raises(InputError, match=r"in 'world'., but y looks like a height: record /tf"):
        read_bag(write_timed(ros2, tmp_path / "hall", found))


@pytest.mark.parametrize("ahead_s", [-7.0, -2.0, -1.0, 0.0, 1.0, 2.5])
@pytest.mark.parametrize("clock", [1.0, 0.2])
def test_transforms_of_another_clock_are_told(ahead_s, clock, ros2, tmp_path, caplog):
    """Else people are placed where the robot was at another time; also where time is simulated."""
    found = []
    for time_s, topic, kind, message in moving_messages(ros2, tf_s=np.arange(0, 12, 0.05) - 0.02):
        if kind == TF:
            stamp_s = time_s + ahead_s
            message = transform(ros2, "odom", "base_link", robot(stamp_s), stamp_s)
        found.append((time_s / clock, topic, kind, message))
    path = write_timed(ros2, tmp_path / "hall", found)
    with suppress(InputError):  # no transform is of the time of people
        read_bag(path)
    told = {-7.0: "7.0 s later", -2.0: "2.0 s later", 2.5: "2.5 s earlier"}.get(ahead_s)
    assert (f"people are stamped {told} than the poses of 'base_link' in 'odom'" in caplog.text) == bool(told)
    assert ("come with them" in caplog.text) == bool(told)


def test_transforms_of_two_robots_with_the_same_frames_are_told(ros2, tmp_path, caplog):
    """People between two of their poses are somewhere between both robots."""
    found = moving_messages(ros2)
    read_bag(write_timed(ros2, tmp_path / "one", found))
    assert "jump in" not in caplog.text
    for k in range(100):
        time_s = 10.0 + 0.05 * k
        pose = Rotation.identity(), np.array([20.0, 5.0, 0.0])
        found.append((time_s, "/tf", TF, transform(ros2, "odom", "base_link", pose, time_s)))
    read_bag(write_timed(ros2, tmp_path / "two", sorted(found, key=lambda one: one[0])))
    assert "the poses of 'base_link' in 'odom' jump in 2" in caplog.text
    assert "do two nodes publish them, or two robots" in caplog.text
