"""Which of a bag's grids is the map, all publishers of a topic, and stamps that say nothing."""

import numpy as np
import pytest
from rosbags import rosbag1
from rosbags.typesys import Stores

from pedpred.command import main
from pedpred.errors import InputError
from pedpred.ros import read_bag
from pedpred.ros.planning import HORIZON
from pedpred.storage.scenes import read_scene, write_map
from tests.bags import GRID, PEOPLE, Filled, Store, check
from tests.worlds import walled_scene

UPDATE = "map_msgs/msg/OccupancyGridUpdate"


def inflated(store, frame="map"):
    grid = store.grid(frame)
    grid.data[:] = 99
    return grid


def bag(store, path, *topics, people="map"):
    """People, a map first on the first topic, and other grids later on the others."""
    grids = [
        (topic, GRID, store.grid() if not n else inflated(store, "odom")) for n, topic in enumerate(topics)
    ]
    store.write(path, [*grids[:1], *seen(store, people), *grids[1:]])
    return path


def update(store, x, frame="map"):
    """A column of blocked cells that changes the map."""
    sizes = {"x": x, "y": 0, "width": 1, "height": 2, "data": np.full(2, 100, np.int8)}
    return "/map_updates", UPDATE, store.make(UPDATE, header=store.header(0.0, frame), **sizes)


def seen(store, frame="map"):
    return [("/people", PEOPLE, store.people(PEOPLE, time_s, frame)) for time_s in (0.0, 0.5, 1.0)]


@pytest.mark.parametrize("name", ["/map", "/robot/map", "/floor_plan"])
def test_costmaps_and_predicted_occupancy_are_no_maps(ros2, tmp_path, name):
    others = ("/local_costmap/costmap", "/global_costmap/costmap", "/predicted_occupancy/step_1")
    check(read_bag(bag(ros2, tmp_path / "hall", name, *others)))


@pytest.mark.parametrize("name", ["/global_costmap/costmap", *(f"{at}{HORIZON}" for at in ("", "/robot"))])
def test_a_bag_with_grids_that_are_no_maps_has_no_map_and_says_so(ros2, tmp_path, caplog, name):
    path = bag(ros2, tmp_path / "hall", name)
    assert not read_bag(path).occupancy.occupied.any()
    assert name in caplog.text
    assert "--map-topic" in caplog.text
    check(read_bag(path, map_topic=name))


def test_the_topic_map_comes_before_others_of_that_name(ros2, tmp_path):
    check(read_bag(bag(ros2, tmp_path / "hall", "/map", "/robot/map", "/lidar")))


def test_a_map_changes_by_its_updates(ros2, tmp_path):
    """The latest whole map counts, and what came after it."""
    store = Filled(0)
    whole, block = ("/map", GRID, store.grid()), [update(store, x) for x in range(3)]
    store.write(tmp_path / "hall", [block[2], whole, block[0], whole, *seen(store), block[2]])
    occupied = read_bag(tmp_path / "hall").occupancy.occupied
    assert np.argwhere(occupied).tolist() == [[1, 0], [2, 0], [2, 1]]


@pytest.mark.parametrize("wrong", ["update outside", "update of another frame", "cells", "size", "tilt"])
def test_a_map_that_is_none_changes_nothing_and_is_told(tmp_path, caplog, wrong):
    store = Filled(0)
    grid = store.grid()
    if wrong.startswith("update"):
        found = update(store, 0, "odom") if wrong.endswith("frame") else update(store, 9)
    else:
        grid.data = {"cells": grid.data - np.int8(50), "size": grid.data[1:], "tilt": grid.data}[wrong]
        grid.info.origin.orientation.x = 0.5 * (wrong == "tilt")
        found = "/map", GRID, grid
    whole, people = ("/map", GRID, store.grid()), seen(store)
    store.write(tmp_path / "hall", [whole, *people, found])
    check(read_bag(tmp_path / "hall"))
    assert f"left out: 1 messages that change the map, the first on {found[0]} (" in caplog.text
    caplog.clear()
    store.write(tmp_path / "again", [whole, found, *people, whole])
    check(read_bag(tmp_path / "again"))
    assert "left out" not in caplog.text
    if found[0] == "/map":
        store.write(tmp_path / "alone", [found, *people])
        with pytest.raises(InputError, match="alone"):
            read_bag(tmp_path / "alone")


def test_a_topic_without_people_is_named(ros2, tmp_path):
    path = bag(ros2, tmp_path / "hall", "/map")
    for topic in ("/map", "/nothing"):
        with pytest.raises(InputError, match=rf"{topic} carries no people, among .*/people"):
            read_bag(path, topic=topic)


def test_a_class_of_people_without_classes_is_refused(ros2, tmp_path):
    path = bag(ros2, tmp_path / "hall", "/map")
    check(read_bag(path))
    with pytest.raises(InputError, match=r"/people has no classes.*people_msgs.*Leave --class out"):
        read_bag(path, classes=("dog",))


def test_several_maps_are_asked_about(ros2, tmp_path):
    path = bag(ros2, tmp_path / "hall", "/lidar", "/plan")
    with pytest.raises(InputError, match=r"'/lidar', '/plan'.*--map-topic"):
        read_bag(path)
    check(read_bag(path, map_topic="/lidar"))
    with pytest.raises(InputError, match="/nothing carries no map"):
        read_bag(path, map_topic="/nothing")


def test_another_map_spares_the_bags_own(ros2, tmp_path):
    """Also one that could not be read: in another frame, or one of several."""
    path = bag(ros2, tmp_path / "hall", "/lidar", "/plan", people="odom")
    world = walled_scene(np.random.default_rng(0))
    write_map(world.occupancy, tmp_path)
    main(["convert", str(path), "-o", str(tmp_path / "scene"), "--map", str(tmp_path / "map.yaml")])
    found = read_scene(tmp_path / "scene").occupancy
    np.testing.assert_array_equal(found.occupied, world.occupancy.occupied)


def test_all_publishers_of_a_topic_are_read(tmp_path):
    """A node that was started again has a connection of its own in a bag of ROS 1."""
    store = Store(Stores.ROS1_NOETIC)
    with rosbag1.Writer(tmp_path / "hall.bag") as writer:
        for count, time_s in enumerate((0.0, 0.5, 1.0)):
            caller = f"/node_{count}"
            one = writer.add_connection("/people", PEOPLE, typestore=store.types, callerid=caller)
            writer.write(one, count, store.types.serialize_ros1(store.people(PEOPLE, time_s), PEOPLE))
    scene = read_bag(tmp_path / "hall.bag")
    np.testing.assert_array_equal(np.unique(scene.trajectories.time_s), [0.0, 0.5, 1.0])
    assert len(scene.trajectories) == 6
