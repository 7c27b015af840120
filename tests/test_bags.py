"""Bags of ROS 1 and ROS 2, in every storage and with every message of tracked people."""

import sqlite3
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest
import zstandard
from lz4.frame import LZ4FrameCompressor
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, Header
from mcap.writer import MCAP0_MAGIC, CompressionType
from rosbags import rosbag1, rosbag2
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from pedpred.command import main
from pedpred.errors import InputError
from pedpred.ros import ADAPTERS, TrackNumbers, read_bag, unpacking, write_recording
from pedpred.storage.scenes import read_scene, write_scene
from tests.bags import PATHS, PEOPLE, Store, check, repacked, stream
from tests.worlds import walled_scene


@pytest.mark.parametrize("kind", sorted(ADAPTERS))
def test_people_come_in_every_message(kind, ros2, tmp_path):
    ros2.write(tmp_path / "hall", stream(ros2, kind))
    check(read_bag(tmp_path / "hall"), (0, 1) if kind.endswith("PoseArray") else tuple(PATHS))


def test_every_storage_is_read(ros2, tmp_path):
    kind = "spencer_tracking_msgs/msg/TrackedPersons"
    old = Store(Stores.ROS1_NOETIC)
    old.write(tmp_path / "hall.bag", stream(old, kind))
    ros2.write(tmp_path / "hall", stream(ros2, kind), rosbag2.StoragePlugin.MCAP)
    check(read_bag(tmp_path / "hall.bag"))
    check(read_bag(tmp_path / "hall"))
    check(read_bag(next((tmp_path / "hall").glob("*.mcap")), "/tracks"))


def test_a_bag_becomes_a_scene_folder_with_another_map(ros2, tmp_path):
    world = walled_scene(np.random.default_rng(0))
    write_scene(world, tmp_path / "room")
    ros2.write(tmp_path / "hall", stream(ros2, "hunav_msgs/msg/Agents"))
    hall, scene, room = (str(tmp_path / name) for name in ("hall", "scene", "room"))
    main(["convert", hall, "-o", scene, "--map", room])
    scene = read_scene(tmp_path / "scene")
    assert scene.trajectories.track_id.tolist() == [3, 8] * 3
    np.testing.assert_array_equal(scene.occupancy.occupied, world.occupancy.occupied)


def test_a_bag_that_makes_no_scene_says_why(ros2, tmp_path):
    kind = "hunav_msgs/msg/Agents"
    ros2.write(tmp_path / "empty", [("/map", "nav_msgs/msg/OccupancyGrid", ros2.grid())])
    with pytest.raises(InputError, match=r"no topic carries people.*map"):
        read_bag(tmp_path / "empty")
    ros2.write(tmp_path / "two", [*stream(ros2, kind), ("/more", kind, ros2.people(kind, 0.5))])
    with pytest.raises(InputError, match=r"several topics.*/more"):
        read_bag(tmp_path / "two")
    check(read_bag(tmp_path / "two", "/tracks"))
    ros2.write(tmp_path / "moved", stream(ros2, kind, "odom"))
    with pytest.raises(InputError, match=r"people in 'odom', map in 'map'.*pose of the people's frame"):
        read_bag(tmp_path / "moved")
    (tmp_path / "torn.bag").write_bytes(b"#ROSBAG V2.0\nnothing")
    with pytest.raises(InputError, match=r"torn\.bag"):
        read_bag(tmp_path / "torn.bag")


def test_names_that_are_no_numbers_become_some():
    names = TrackNumbers()
    assert [names.number(name) for name in ("7", "anna", 12, "ben", "anna")] == [7, -1, 12, -2, -1]


def test_the_standard_types_read_every_standard_message_of_a_recording(tmp_path):
    """With the types of ROS 2 Humble instead of the definitions in the file."""
    scene = walled_scene(np.random.default_rng(0), detections=20)
    write_recording(scene, tmp_path / "hall.mcap")
    standard, read = get_typestore(Stores.ROS2_HUMBLE), SimpleNamespace(standard=0, people=0)
    with AnyReader([tmp_path / "hall.mcap"]) as bag:
        for connection, time_ns, raw in bag.messages():
            if connection.msgtype in standard.types:
                message = standard.deserialize_cdr(raw, connection.msgtype)
                read.standard += 1
            else:
                message = bag.deserialize(raw, connection.msgtype)
                read.people += len(message.people)
                assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == time_ns
            assert message.__msgtype__ == connection.msgtype
    assert read.people == len(scene.trajectories)
    assert read.standard == 2 + len(np.unique(scene.trajectories.time_s))


@pytest.mark.parametrize("compression", list(CompressionType))
def test_chunks_may_be_compressed_in_every_way(compression, tmp_path):
    world = walled_scene(np.random.default_rng(0), detections=20)
    write_recording(world, tmp_path / "zstd.mcap")
    repacked(tmp_path / "zstd.mcap", tmp_path / "hall.mcap", compression)
    found = read_bag(tmp_path / "hall.mcap").trajectories.track_id
    np.testing.assert_array_equal(found, world.trajectories.track_id)


@pytest.mark.parametrize("compression", ["", "lz4", "zstd"])
@pytest.mark.parametrize("honest", [True, False])
def test_a_chunk_that_would_fill_the_memory_is_refused(compression, honest, tmp_path):
    """Whether it declares its size or not; half a gigabyte of zeros is half a megabyte of lz4."""
    held = 2**29
    squeezed = {"": lambda: b"\0", "lz4": lambda: lz4_of_zeros(held), "zstd": lambda: zstd_of_zeros(held)}
    with (tmp_path / "bomb.mcap").open("wb") as stream:
        stream.write(MCAP0_MAGIC)
        builder = RecordBuilder()
        Header("ros2", "").write(builder)
        claimed = held if honest or not compression else 1
        Chunk(compression, squeezed[compression](), 0, 0, 0, claimed).write(builder)
        stream.write(builder.end())
        stream.write(MCAP0_MAGIC)
    with pytest.raises(InputError, match=r"bomb\.mcap.*at most 134217728 bytes"):
        read_bag(tmp_path / "bomb.mcap")


def write_compressed(version, compression, path):
    """Write a bag whose chunks (ROS 1) or messages (ROS 2) are compressed."""
    store = Store(version)
    ros2 = {"version": 9, "storage_plugin": rosbag2.StoragePlugin.SQLITE3}
    writer = rosbag1.Writer(path) if store.ros1 else rosbag2.Writer(path, **ros2)
    writer.set_compression(*compression)
    store.fill(writer, stream(store, PEOPLE))


COMPRESSED = {
    "bz2": (Stores.ROS1_NOETIC, (rosbag1.Writer.CompressionFormat.BZ2,)),
    "lz4": (Stores.ROS1_NOETIC, (rosbag1.Writer.CompressionFormat.LZ4,)),
    "zstd": (Stores.ROS2_HUMBLE, (rosbag2.CompressionMode.MESSAGE, rosbag2.CompressionFormat.ZSTD)),
}


@pytest.mark.parametrize("kind", COMPRESSED)
def test_what_is_compressed_inside_a_bag_is_unpacked_within_the_bound(kind, tmp_path, monkeypatch):
    path = tmp_path / ("hall" if kind == "zstd" else "hall.bag")
    write_compressed(*COMPRESSED[kind], path)
    for whole in (path, *path.glob("*.db3")):  # also where no metadata.yaml says so
        check(read_bag(whole))
    monkeypatch.setattr(unpacking, "LARGEST_CHUNK_BYTES", 60)
    with pytest.raises(InputError, match=rf"{path.name}.*at most 60 bytes"):
        read_bag(path)


def test_one_message_that_would_unpack_to_too_much_refuses_the_bag(tmp_path, monkeypatch):
    """It is not damaged, and is not left out like one that is."""
    write_compressed(*COMPRESSED["zstd"], tmp_path / "hall")
    within, sizes = unpacking.check_unpacked, []

    def checked(size):
        monkeypatch.setattr(unpacking, "LARGEST_CHUNK_BYTES", 60 if len(sizes) == 1 else 2**27)
        sizes.append(size)
        within(size)

    monkeypatch.setattr(unpacking, "check_unpacked", checked)
    with pytest.raises(InputError, match=r"hall.*at most 60 bytes"):
        read_bag(tmp_path / "hall")
    assert len(sizes) == 2


def lz4_of_zeros(count):
    packer, block = LZ4FrameCompressor(), bytes(2**22)
    return packer.begin() + b"".join(packer.compress(block) for _ in range(count // 2**22)) + packer.flush()


def zstd_of_zeros(count):
    packer, block = zstandard.ZstdCompressor().compressobj(size=count), bytes(2**22)
    return b"".join(packer.compress(block) for _ in range(count // 2**22)) + packer.flush()


@pytest.mark.parametrize(
    "computed",
    [
        "CREATE VIEW schema AS WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n) "
        "SELECT x AS schema_version FROM n WHERE x < 0",
        "CREATE VIEW more AS SELECT 1",
        "CREATE TABLE large (x, data GENERATED ALWAYS AS (zeroblob(1000000000)))",
    ],
    ids=["endless", "view", "computed column"],
)
def test_a_bag_whose_tables_are_computed_is_refused(computed, tmp_path):
    """The first one would be searched for ever for a version that it does not hold."""
    store = Store(Stores.ROS2_HUMBLE)
    store.write(tmp_path / "hall", stream(store, PEOPLE))
    with closing(sqlite3.connect(tmp_path / "hall" / "hall.db3")) as base:
        base.execute("DROP TABLE IF EXISTS schema")
        base.execute(computed)
        base.commit()
    for path in (tmp_path / "hall", tmp_path / "hall" / "hall.db3"):
        with pytest.raises(InputError, match=r"hall.*nothing that is computed"):
            read_bag(path)
