"""Which of a bag's grids is the map, how a grid becomes one, and all publishers of a topic."""

from types import SimpleNamespace as Message

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags import rosbag1
from scipy.spatial.distance import cdist

from pedpred.command import main
from pedpred.errors import InputError, ValueRuleError
from pedpred.geometry import rotate
from pedpred.ros import map_of_grid, read_bag
from pedpred.ros.grids import HORIZON
from pedpred.storage.scenes import read_scene, write_map
from tests.bags import GRID, PEOPLE, Store, check, stream
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


@pytest.mark.parametrize("name", ["/map", "/robot/map", "/floor_plan"])
def test_costmaps_and_predicted_occupancy_are_no_maps(ros2, tmp_path, name):
    others = ("/local_costmap/costmap", "/global_costmap/costmap", "/predicted_occupancy/step_1")
    check(read_bag(write_grids(ros2, tmp_path / "hall", name, *others)))


@pytest.mark.parametrize("name", ["/global_costmap/costmap", f"/robot{HORIZON}"])
def test_a_bag_whose_grids_are_no_maps_has_free_ground(ros2, tmp_path, caplog, name):
    path = write_grids(ros2, tmp_path / "hall", name)
    assert not read_bag(path).occupancy.occupied.any()
    assert name in caplog.text
    assert "--map-topic" in caplog.text
    check(read_bag(path, map_topic=name))


def test_the_topic_map_comes_before_others_of_that_name(ros2, tmp_path):
    check(read_bag(write_grids(ros2, tmp_path / "hall", "/map", "/robot/map", "/lidar")))


def test_several_maps_are_refused(ros2, tmp_path):
    path = write_grids(ros2, tmp_path / "hall", "/lidar", "/plan")
    for topic in (None, "/nothing"):
        with pytest.raises(InputError) as error:
            read_bag(path, map_topic=topic)
        assert "--map-topic" in str(error.value)
    check(read_bag(path, map_topic="lidar"))


def test_a_map_changes_by_its_updates(ros2, tmp_path):
    """The latest whole map counts, and what came after it."""
    whole, block = ("/map", GRID, ros2.grid()), [update(ros2, x) for x in range(3)]
    ros2.write(tmp_path / "hall", [block[2], whole, block[0], whole, *people_only(ros2), block[2]])
    occupied = read_bag(tmp_path / "hall").occupancy.occupied
    assert np.argwhere(occupied).tolist() == [[1, 0], [2, 0], [2, 1]]


@pytest.mark.parametrize("wrong", ["update outside", "update of another frame", "cells", "size", "tilt"])
def test_a_map_that_is_wrong_leaves_the_one_before(ros2, tmp_path, caplog, wrong):
    grid = ros2.grid()
    if wrong.startswith("update"):
        found = update(ros2, 0, "odom") if wrong.endswith("frame") else update(ros2, 9)
    else:
        grid.data = {"cells": grid.data - np.int8(50), "size": grid.data[1:], "tilt": grid.data}[wrong]
        grid.info.origin.orientation.x = 0.5 * (wrong == "tilt")
        found = "/map", GRID, grid
    ros2.write(tmp_path / "hall", [("/map", GRID, ros2.grid()), *people_only(ros2), found])
    check(read_bag(tmp_path / "hall"))
    assert any(record.name == "pedpred.ros.bags" for record in caplog.records)
    if found[0] == "/map":
        with pytest.raises(InputError):
            read_bag(ros2.write(tmp_path / "alone", [found, *people_only(ros2)]))


def test_options_that_a_bag_cannot_meet_are_refused(ros2, tmp_path):
    path = write_grids(ros2, tmp_path / "hall", "/map")
    for options, text in (
        ({"topic": "/map"}, "/people"),
        ({"topic": "/nothing"}, "/people"),
        ({"classes": ("dog",)}, "--class"),
    ):
        with pytest.raises(InputError) as error:
            read_bag(path, **options)
        assert text in str(error.value)
    check(read_bag(path, topic="people"))


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


def sized(width, height):
    turn, corner = Message(x=0.0, y=0.0, z=0.0, w=1.0), Message(x=3.0, y=-2.0)
    origin = Message(position=corner, orientation=turn)
    return Message(width=width, height=height, resolution=0.1, origin=origin)


def turned(cells, yaw_rad, **orientation):
    info = sized(*cells.shape)
    vars(info.origin.orientation).update({"z": np.sin(yaw_rad / 2), "w": np.cos(yaw_rad / 2)} | orientation)
    return Message(info=info, data=np.where(cells.T, 100, 0).astype(np.int8).ravel())


def test_unknown_cells_are_free_and_others_are_percentages():
    read = map_of_grid(Message(info=sized(5, 1), data=np.array([-1, 0, 50, 51, 100], np.int8)))
    assert read.occupied[:, 0].tolist() == [False, False, False, True, True]
    for odd in (-2, 127):
        with pytest.raises(ValueRuleError) as error:
            map_of_grid(Message(info=sized(2, 1), data=np.array([0, odd], np.int8)))
        assert (error.value.field, error.value.value) == ("data", odd)


@given(st.floats(-3.2, 3.2), st.integers(0, 2**32))
@settings(max_examples=30)
def test_walls_of_a_turned_map_are_where_they_are(yaw_rad, seed):
    """Every blocked cell is found at its centre, and nothing is blocked a cell away from all of them."""
    cells = np.random.default_rng(seed).random((12, 7)) < 0.2
    read = map_of_grid(turned(cells, yaw_rad))
    centres = np.argwhere(cells) * 0.1 + 0.05
    there = np.array([3.0, -2.0]) + rotate(centres, np.full(len(centres), yaw_rad))
    assert read.occupied[tuple(read.cell_of(there).T)].all()
    found = read.origin + (np.argwhere(read.occupied) + 0.5) * read.resolution_m
    if len(found):
        assert cdist(found, there).min(axis=1).max() < 0.15


def test_a_right_angle_keeps_the_cells_of_a_map():
    cells = np.random.default_rng(0).random((5, 3)) < 0.5
    np.testing.assert_array_equal(map_of_grid(turned(cells, np.pi / 2)).occupied, cells.T[::-1])


def test_a_tilted_map_is_refused():
    with pytest.raises(ValueRuleError) as error:
        map_of_grid(turned(np.zeros((5, 3), bool), 0.0, x=0.1))
    assert error.value.field == "origin.orientation"


def test_a_map_is_refused_before_its_cells_are_read():
    """The same bound as that of every map, so that what can be written can be read."""
    with pytest.raises(ValueRuleError):
        map_of_grid(Message(info=sized(9000, 9000)))  # it has no data
