"""Which of a bag's grids is the map, how a grid becomes one, and all publishers of a topic."""

from types import SimpleNamespace as Message

import numpy as np
import pytest
from rosbags import rosbag1

from pedpred.command import main
from pedpred.ros import map_of_grid, read_bag
from pedpred.ros.grids import HORIZON
from pedpred.ros.scene_messages import updated_grid
from pedpred.storage.scenes import read_scene, write_map
from tests.bags import GRID, PATHS, PEOPLE, Store, check, stream
from tests.refused import refused, unread
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


def update(store, x, frame="map", value=100):
    """A column of blocked cells that changes the map."""
    sizes = {"x": x, "y": 0, "width": 1, "height": 2, "data": np.full(2, value, np.int8)}
    return store.make(UPDATE, header=store.header(0.0, frame), **sizes)


@pytest.mark.parametrize(
    ("name", "others"),
    [
        ("/map", ("/robot/map", "/lidar")),
        ("/floor_plan", ("/local_costmap/costmap", "/predicted_occupancy/step_1")),
    ],
)
def test_costmaps_and_predicted_occupancy_are_no_maps(name, others, ros2, tmp_path):
    check(read_bag(write_grids(ros2, tmp_path / "hall", name, *others)))


def test_a_bag_whose_grids_are_no_maps_has_free_ground(ros2, tmp_path, caplog):
    path = write_grids(ros2, tmp_path / "hall", f"/robot{HORIZON}")
    assert not read_bag(path).occupancy.occupied.any()
    assert "--map-topic" in caplog.text
    check(read_bag(path, map_topic=f"/robot{HORIZON}"))


def test_several_maps_are_refused_and_options_must_fit(ros2, tmp_path):
    path = write_grids(ros2, tmp_path / "hall", "/lidar", "/plan")
    for options, remedy in (
        ({}, "--map-topic"),
        ({"map_topic": "/nothing"}, "--map-topic"),
        ({"map_topic": "lidar", "topic": "/lidar"}, "/people"),
        ({"map_topic": "lidar", "classes": ("dog",)}, "--class"),
    ):
        with unread(path, remedy=remedy):
            read_bag(path, **options)
    check(read_bag(path, map_topic="lidar", topic="people"))


def test_a_map_changes_by_its_updates(ros2, tmp_path, caplog):
    """The latest whole map counts, and what came after it and fits."""
    whole, block = ("/map", GRID, ros2.grid()), [("/map_updates", UPDATE, update(ros2, x)) for x in (0, 2, 9)]
    ros2.write(tmp_path / "hall", [block[1], whole, block[0], whole, *people_only(ros2), *block[1:]])
    occupied = read_bag(tmp_path / "hall").occupancy.occupied
    assert np.argwhere(occupied).tolist() == [[1, 0], [2, 0], [2, 1]]
    assert any(record.name == "pedpred.ros.bags" for record in caplog.records)


def test_people_of_any_type_are_read_on_another_map(ros2, tmp_path):
    """Maps of the bag do not count then, also those that could not be read: in another frame, or several."""
    world = walled_scene(np.random.default_rng(0))
    write_map(world.occupancy, tmp_path)
    people = list(stream(ros2, "hunav_msgs/msg/Agents", "odom"))[1:]
    grids = [(topic, GRID, ros2.grid()) for topic in ("/lidar", "/plan")]
    given = ["--people", "agents,id=id,position=position.position", "--topic", "/tracks"]
    given += ["--identities", "given", "--map", str(tmp_path / "map.yaml")]
    path, out = ros2.write(tmp_path / "hall", [*grids, *people]), tmp_path / "scene"
    main(["convert", str(path), "-o", str(out), *given])
    found = read_scene(out)
    assert found.trajectories.track_id.tolist() == [*PATHS] * 3
    np.testing.assert_array_equal(found.occupancy.occupied, world.occupancy.occupied)


def test_all_publishers_of_a_topic_are_read(tmp_path):
    """A node that was started again has a connection of its own in a bag of ROS 1."""
    store = Store(ros1=True)
    with rosbag1.Writer(tmp_path / "hall.bag") as writer:
        for count, (topic, kind, message) in enumerate(people_only(store)):
            one = writer.add_connection(topic, kind, typestore=store.types, callerid=f"/node_{count}")
            writer.write(one, count, store.raw(PEOPLE, message))
    assert len(read_bag(tmp_path / "hall.bag").trajectories) == 6


# Grids, in a bag or live


def sized(width, height, data=None, x=3.0, resolution=0.1, **orientation):
    turn = Message(**{"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0} | orientation)
    origin = Message(position=Message(x=x, y=-2.0), orientation=turn)
    info = Message(width=width, height=height, resolution=resolution, origin=origin)
    return Message(info=info, data=np.zeros(width * height, np.int8) if data is None else data)


def test_unknown_cells_are_free_and_others_are_percentages():
    read = map_of_grid(sized(5, 1, np.array([-1, 0, 50, 51, 100], np.int8)))
    assert read.occupied[:, 0].tolist() == [False, False, False, True, True]


def test_a_right_angle_keeps_the_cells_of_a_map():
    cells = np.random.default_rng(0).random((5, 3)) < 0.5
    data = np.where(cells.T, 100, 0).astype(np.int8).ravel()
    read = map_of_grid(sized(5, 3, data, z=np.sqrt(0.5), w=np.sqrt(0.5)))
    np.testing.assert_array_equal(read.occupied, cells.T[::-1])


def test_a_grid_that_is_no_map_is_refused():
    for grid, field in (
        (sized(2, 1, np.array([0, -2], np.int8)), "data"),
        (sized(2, 1, np.zeros(3, np.int8)), "data"),
        (sized(0, 1), "occupied"),
        (sized(9000, 9000, np.zeros(1, np.int8)), "occupied"),  # before its cells are read
        (sized(2, 1, resolution=0.0), "resolution"),
        (sized(2, 1, y=0.5), "orientation"),
    ):
        with refused(field):
            map_of_grid(grid)


def test_an_update_that_does_not_fit_is_refused(ros2):
    for field, wrong in (("update", update(ros2, 3)), ("frame_id", update(ros2, 0, "odom"))):
        with refused(field):
            updated_grid(ros2.grid(), wrong)
