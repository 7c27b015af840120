"""Which of a bag's grids is the map, how a grid becomes one, and all publishers of a topic."""

from types import SimpleNamespace as Message

import numpy as np
import pytest
from rosbags import rosbag1

from pedpred.command import main
from pedpred.errors import InputError
from pedpred.ros import map_of_grid, read_bag
from pedpred.ros.grids import HORIZON
from pedpred.storage.scenes import read_scene, write_map
from tests.bags import GRID, PEOPLE, Store, check, stream
from tests.refused import refused
from tests.worlds import walled_scene

UPDATE = "map_msgs/msg/OccupancyGridUpdate"


def write_grids(store, path, *topics, people="map"):
    """People, a map first on the first topic, and other grids later on the others."""
    grids = [(topic, GRID, store.grid("odom" if n else "map")) for n, topic in enumerate(topics)]
    for _, _, grid in grids[1:]:
        grid.data[:] = 99
    return store.write(path, [*grids[:1], *people_only(store, people), *grids[1:]])


def people_only(store, frame="map"):
    return list(stream(store, frame=frame, topic="/people"))[1:]


def update(store, x, frame="map"):
    """A column of blocked cells that changes the map."""
    sizes = {"x": x, "y": 0, "width": 1, "height": 2, "data": np.full(2, 100, np.int8)}
    return "/map_updates", UPDATE, store.make(UPDATE, header=store.header(0.0, frame), **sizes)


@pytest.mark.parametrize(
    ("name", "others"),
    [
        ("/map", ("/robot/map", "/lidar")),
        ("/robot/map", ("/local_costmap/costmap", "/global_costmap/costmap", "/predicted_occupancy/step_1")),
        ("/floor_plan", ("/local_costmap/costmap", "/predicted_occupancy/step_1")),
    ],
)
def test_costmaps_and_predicted_occupancy_are_no_maps(name, others, ros2, tmp_path):
    check(read_bag(write_grids(ros2, tmp_path / "hall", name, *others)))


@pytest.mark.parametrize("name", ["/global_costmap/costmap", f"/robot{HORIZON}"])
def test_a_bag_whose_grids_are_no_maps_has_free_ground(name, ros2, tmp_path, caplog):
    path = write_grids(ros2, tmp_path / "hall", name)
    assert not read_bag(path).occupancy.occupied.any()
    assert "--map-topic" in caplog.text
    check(read_bag(path, map_topic=name))


def test_several_maps_are_refused_and_options_must_fit(ros2, tmp_path):
    path = write_grids(ros2, tmp_path / "hall", "/lidar", "/plan")
    for options, remedy in (
        ({}, "--map-topic"),
        ({"map_topic": "/nothing"}, "--map-topic"),
        ({"map_topic": "lidar", "topic": "/lidar"}, "/people"),
        ({"map_topic": "lidar", "topic": "/nothing"}, "/people"),
        ({"map_topic": "lidar", "classes": ("dog",)}, "--class"),
    ):
        with pytest.raises(InputError) as error:
            read_bag(path, **options)
        assert remedy in str(error.value)
    check(read_bag(path, map_topic="lidar", topic="people"))


def test_a_map_changes_by_its_updates(ros2, tmp_path):
    """The latest whole map counts, and what came after it."""
    whole, block = ("/map", GRID, ros2.grid()), [update(ros2, x) for x in range(3)]
    ros2.write(tmp_path / "hall", [block[2], whole, block[0], whole, *people_only(ros2), block[2]])
    occupied = read_bag(tmp_path / "hall").occupancy.occupied
    assert np.argwhere(occupied).tolist() == [[1, 0], [2, 0], [2, 1]]


@pytest.mark.parametrize("wrong", ["update outside", "update of another frame", "cells", "size", "tilt"])
def test_a_map_that_is_wrong_leaves_the_one_before(wrong, ros2, tmp_path, caplog):
    grid = ros2.grid()
    if wrong.startswith("update"):
        found = update(ros2, 0, "odom") if wrong.endswith("frame") else update(ros2, 9)
    else:
        grid.data = {"cells": grid.data - np.int8(50), "size": grid.data[1:], "tilt": grid.data}[wrong]
        grid.info.origin.orientation.x = 0.5 * (wrong == "tilt")
        found = "/map", GRID, grid
    check(read_bag(ros2.write(tmp_path / "hall", [("/map", GRID, ros2.grid()), *people_only(ros2), found])))
    assert any(record.name == "pedpred.ros.bags" for record in caplog.records)
    if found[0] == "/map":
        with pytest.raises(InputError):
            read_bag(ros2.write(tmp_path / "alone", [found, *people_only(ros2)]))


def test_a_map_of_the_command_replaces_the_maps_of_the_bag(ros2, tmp_path):
    """Also those that could not be read: in another frame, or several."""
    path = write_grids(ros2, tmp_path / "hall", "/lidar", "/plan", people="odom")
    world = walled_scene(np.random.default_rng(0))
    write_map(world.occupancy, tmp_path)
    main(["convert", str(path), "-o", str(tmp_path / "scene"), "--map", str(tmp_path / "map.yaml")])
    found = read_scene(tmp_path / "scene").occupancy
    np.testing.assert_array_equal(found.occupied, world.occupancy.occupied)


def test_all_publishers_of_a_topic_are_read(tmp_path):
    """A node that was started again has a connection of its own in a bag of ROS 1."""
    store = Store(ros1=True)
    with rosbag1.Writer(tmp_path / "hall.bag") as writer:
        for count, (topic, kind, message) in enumerate(people_only(store)):
            one = writer.add_connection(topic, kind, typestore=store.types, callerid=f"/node_{count}")
            writer.write(one, count, store.raw(PEOPLE, message))
    assert len(read_bag(tmp_path / "hall.bag").trajectories) == 6


# Grids


def sized(width, height, **orientation):
    turn = Message(**{"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0} | orientation)
    origin = Message(position=Message(x=3.0, y=-2.0), orientation=turn)
    return Message(width=width, height=height, resolution=0.1, origin=origin)


def test_unknown_cells_are_free_and_others_are_percentages():
    read = map_of_grid(Message(info=sized(5, 1), data=np.array([-1, 0, 50, 51, 100], np.int8)))
    assert read.occupied[:, 0].tolist() == [False, False, False, True, True]
    for odd in (-2, 127):
        with refused("data"):
            map_of_grid(Message(info=sized(2, 1), data=np.array([0, odd], np.int8)))


def test_a_right_angle_keeps_the_cells_of_a_map():
    cells = np.random.default_rng(0).random((5, 3)) < 0.5
    data = np.where(cells.T, 100, 0).astype(np.int8).ravel()
    read = map_of_grid(Message(info=sized(5, 3, z=np.sqrt(0.5), w=np.sqrt(0.5)), data=data))
    np.testing.assert_array_equal(read.occupied, cells.T[::-1])


def test_a_map_is_refused_before_its_cells_are_read():
    """By the bound of every map, so that what can be written can be read."""
    with refused("occupied"):
        map_of_grid(Message(info=sized(9000, 9000)))  # it has no data
