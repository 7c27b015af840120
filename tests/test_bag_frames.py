"""People of a bag come into the frame of the map, or an error says what to record."""

import numpy as np
import pytest

from pedpred.errors import InputError
from pedpred.online import OnlinePredictor
from pedpred.online.replay import replay_scene
from pedpred.ros import Transform, read_bag
from tests.bags import PEOPLE, Store, bag, check_moving, moving_bag, stream
from tests.refused import refused, unread
from tests.robots import ODOM, from_camera


def test_a_person_who_stands_before_a_moving_robot_stands(ros2, tmp_path):
    """Also by the forecasts: slower than 0.05 m/s, as live (`test_ros_node.py`)."""
    scene = read_bag(moving_bag(ros2, tmp_path / "hall", "camera", from_camera))
    check_moving(scene)
    for forecast in replay_scene(scene, OnlinePredictor.load()):
        assert np.linalg.norm(forecast.velocity[forecast.track_id == 1][:, 0], axis=-1).max() < 0.05


@pytest.mark.parametrize(
    ("grid", "localised", "pose", "ros1"),
    [("map", True, ODOM, False), (None, True, ODOM, True), ("odom", True, None, False)],
)
def test_people_come_into_the_frame_of_the_map(grid, localised, pose, ros1, tmp_path):
    path = tmp_path / ("hall.bag" if ros1 else "hall")
    check_moving(read_bag(moving_bag(Store(ros1=ros1), path, localised=localised, grid=grid)), pose)


def test_people_are_identified_by_position_in_the_fixed_frame(ros2, tmp_path):
    """In the robot's own frame they would change places as it turns."""
    people = read_bag(moving_bag(ros2, tmp_path / "hall"), identities="assigned").trajectories
    assert np.unique(people.track_id, return_counts=True)[1].tolist() == [50, 50]


def test_a_frame_that_does_not_lead_to_the_map_is_refused(ros2, tmp_path):
    path = moving_bag(ros2, tmp_path / "hall", grid="map")
    with unread(path, remedy="--map-topic"):
        read_bag(path)
    check_moving(read_bag(path, map_topic=""))


def test_a_given_transform_is_that_of_the_topmost_frame(ros2, tmp_path):
    given = Transform(-4.0, 1.5, 0.7)
    check_moving(read_bag(moving_bag(ros2, tmp_path / "hall", grid="map"), transform=given), ODOM)
    localised = moving_bag(ros2, tmp_path / "all", localised=True, grid="map")
    with unread(localised, remedy="--transform"):
        read_bag(localised, transform=given)


def test_detections_without_a_transform_are_left_out(ros2, tmp_path, caplog):
    """Before the first one and after the last one: poses are not extrapolated."""
    tf_s = np.arange(1.0, 4.51, 0.05)
    scene = read_bag(moving_bag(ros2, tmp_path / "hall", tf_s=tf_s))
    check_moving(scene)
    here = np.unique(scene.trajectories.time_s) - 10.0
    assert (here.min(), here.max()) == (pytest.approx(1.0), pytest.approx(4.5))
    assert f"{100 - 2 * len(here)} of 100" in caplog.text
    with pytest.raises(InputError):
        read_bag(moving_bag(ros2, tmp_path / "late", tf_s=tf_s + 100.0))


def test_sensors_without_transforms_are_doubted(ros2, tmp_path, caplog):
    """Fixed frames need none; people in the frame of a lens stand on no floor."""
    none = np.zeros(0)
    for frame, warns in (("robot1/velodyne", True), ("base_link", True), ("odom", False)):
        caplog.clear()
        read_bag(moving_bag(ros2, tmp_path / frame.replace("/", "_"), frame, tf_s=none))
        assert ("/tf" in caplog.text) == warns, frame
    lens = moving_bag(ros2, tmp_path / "lens", "camera_optical_frame", from_camera, tf_s=none)
    with unread(lens, remedy="/tf"):
        read_bag(lens)


def test_the_frame_of_a_message_without_people_does_not_count(ros2, tmp_path):
    """Many trackers fill in nothing when there are no people."""
    for frame in ("", "base_link"):
        empty = "/tracks", PEOPLE, ros2.people(PEOPLE, 0.7, {}, frame)
        assert len(read_bag(ros2.write(tmp_path / f"x{frame}", [*stream(ros2), empty])).trajectories) == 6


def test_people_in_another_frame_need_its_pose(ros2, tmp_path):
    steps = [(0.0, {"3": (1.0, 0.0)}), (0.5, {"3": (2.0, 0.0)})]
    path = bag(ros2, tmp_path / "bag", *steps, frame="odom")
    with unread(path, remedy="--transform"):
        read_bag(path)
    people = read_bag(path, transform=Transform(10.0, 20.0, np.pi / 2)).trajectories
    np.testing.assert_allclose(people.position, [[10, 21], [10, 22]])
    assert len(read_bag(bag(ros2, tmp_path / "bare", *steps, frame="odom", grid=False)).trajectories) == 2
    with refused("yaw_rad"):
        Transform(0.0, 0.0, 90.0)
