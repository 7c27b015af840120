"""Bags of ROS 1 and ROS 2: every storage, every message of people, order and time, bounded sizes."""

import sqlite3
from contextlib import closing

import numpy as np
import pytest
import zstandard
from lz4.frame import LZ4FrameCompressor
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, Header
from mcap.writer import MCAP0_MAGIC, CompressionType
from rosbags import rosbag1, rosbag2

from pedpred.errors import InputError
from pedpred.ros import PEOPLE_FIELDS, read_bag, unpacking
from pedpred.ros.definitions import EDITIONS
from tests.bags import GRID, PEOPLE, Store, bag, check, repacked, stream, tracks_of, write_mcap
from tests.refused import unread


def edit(folder, script):
    """Run SQL on the database of a bag; its folder."""
    with closing(sqlite3.connect(folder / "hall.db3")) as base:
        base.executescript(script)
    return folder


@pytest.mark.parametrize("edition", range(len(EDITIONS)))
def test_every_type_is_known_without_definitions(edition, tmp_path):
    """As of a recorder on which the package is not installed."""
    for kind in sorted(PEOPLE_FIELDS):
        path = write_mcap(Store(edition), tmp_path / "hall.mcap", kind, "cdr", "ros2msg")
        has_ids = edition < 2 or "vision" not in kind
        check(read_bag(path), tracks_of(kind if has_ids else "geometry_msgs/msg/PoseArray"))


@pytest.mark.parametrize(
    "change",
    [
        "DROP TABLE message_definitions; UPDATE schema SET schema_version = 3;",
        "UPDATE message_definitions SET encoding = 'unknown', encoded_message_definition = '';",
    ],
    ids=["before Iron", "empty"],
)
def test_databases_may_lack_definitions(change, ros2, tmp_path):
    check(read_bag(edit(ros2.write(tmp_path / "hall", stream(ros2)), change)))


@pytest.mark.parametrize("defined", [True, False])
def test_messages_of_ros_1_in_mcap_are_read(defined, tmp_path):
    """As `mcap convert` writes."""
    store = Store(ros1=True)
    check(read_bag(write_mcap(store, tmp_path / "hall.mcap", PEOPLE, "ros1", "ros1msg", defined)))


@pytest.mark.parametrize("packing", ["none", "BZ2", "LZ4"])
def test_a_bag_of_ros_1_is_read_however_it_is_packed(packing, tmp_path):
    writer, store = rosbag1.Writer(tmp_path / "hall.bag"), Store(ros1=True)
    if packing != "none":
        writer.set_compression(rosbag1.Writer.CompressionFormat[packing])
    store.fill(writer, stream(store))
    check(read_bag(tmp_path / "hall.bag"))


@pytest.mark.parametrize("packing", list(CompressionType))
def test_mcap_is_read_however_its_chunks_are_packed(packing, ros2, tmp_path):
    folder = ros2.write(tmp_path / "hall", stream(ros2), rosbag2.StoragePlugin.MCAP)
    check(read_bag(folder))
    repacked(next(folder.glob("*.mcap")), tmp_path / "hall.mcap", packing)
    check(read_bag(tmp_path / "hall.mcap", "/tracks"))


@pytest.mark.parametrize(("ids", "names"), [("id=track_id,", (3, 8)), ("", (1, 2))])
def test_people_of_any_type_are_read_by_their_fields(ids, names, ros2, tmp_path):
    """Here as if the type were not known; positions alone are assigned."""
    path = ros2.write(tmp_path / "hall", stream(ros2, "spencer_tracking_msgs/msg/TrackedPersons"))
    check(read_bag(path, "/tracks", fields=f"tracks , {ids}position=pose.pose.position"), names)


def test_what_makes_no_scene_is_refused_with_a_remedy(ros2, tmp_path):
    ros2.write(tmp_path / "empty", [("/map", GRID, ros2.grid())])
    ros2.write(tmp_path / "two", [*stream(ros2), *stream(ros2, topic="/more")])
    write_mcap(Store(), tmp_path / "json.mcap", PEOPLE, "json", "jsonschema")
    (tmp_path / "old.bag").write_bytes(b"#ROSBAG V1.2\nold")
    with closing(sqlite3.connect(tmp_path / "simulation.db3")) as base:
        base.executescript("CREATE TABLE trajectory_data (frame, id, pos_x, pos_y);")
    remedies = {
        "empty": "--people",
        "two": "--topic",
        "json.mcap": "json",
        "old.bag": "rosbag fix",
        "simulation.db3": ".sqlite",
    }
    for name, remedy in remedies.items():
        with unread(tmp_path / name, remedy=remedy):
            read_bag(tmp_path / name)
    check(read_bag(tmp_path / "two", "/tracks"))


# Order and time


def walk(start_s, count=40):
    return [(start_s + k / 10, {"3": (k / 10, 1.0), "8": (9.0, k / 10)}) for k in range(count)]


def test_messages_that_come_late_are_sorted(ros2, tmp_path):
    steps = walk(100.0)
    steps[5], steps[6], steps[20], steps[28] = steps[6], steps[5], steps[28], steps[20]
    people = read_bag(bag(ros2, tmp_path / "hall", *steps)).trajectories
    np.testing.assert_allclose(people.position[people.track_id == 3, 0], np.arange(40) / 10)


def test_times_without_stamps_are_those_of_the_bag(ros2, tmp_path):
    steps = [(0.0, people) for _, people in walk(100.0)]
    people = read_bag(bag(ros2, tmp_path / "hall", *steps)).trajectories
    np.testing.assert_allclose(np.unique(people.time_s), np.arange(1, 41) / 1e9)


def test_times_that_restart_or_are_no_seconds_are_refused(ros2, tmp_path, caplog):
    """People who run are warned about."""
    slow = ((100.0 * k, {"3": (0.1 * k, 0.0)}) for k in range(20))
    for name, steps in {"again": [*walk(100.0), *walk(100.0)], "slow": slow}.items():
        with pytest.raises(InputError):
            read_bag(bag(ros2, tmp_path / name, *steps))
    read_bag(bag(ros2, tmp_path / "run", *((k / 10, {"3": (k, 0.0)}) for k in range(20))))
    assert [record.name for record in caplog.records] == ["pedpred.reading.checks"]


# Sizes


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_a_chunk_that_would_fill_the_memory_is_refused(compression, tmp_path):
    """Half a gigabyte of zeros, whose size is declared falsely."""
    packer = LZ4FrameCompressor() if compression == "lz4" else zstandard.ZstdCompressor().compressobj()
    parts = [packer.begin()] if compression == "lz4" else []
    parts += [*(packer.compress(bytes(2**22)) for _ in range(2**7)), packer.flush()]
    with (tmp_path / "bomb.mcap").open("wb") as file:
        file.write(MCAP0_MAGIC)
        builder = RecordBuilder()
        Header("ros2", "").write(builder)
        Chunk(compression, b"".join(parts), 0, 0, 0, 1).write(builder)
        file.write(builder.end())
        file.write(MCAP0_MAGIC)
    with unread(tmp_path / "bomb.mcap", remedy=str(unpacking.LARGEST_BYTES)):
        read_bag(tmp_path / "bomb.mcap")


def test_messages_are_unpacked_within_the_bound(ros2, tmp_path, monkeypatch):
    writer = rosbag2.Writer(tmp_path / "hall", version=9, storage_plugin=rosbag2.StoragePlugin.SQLITE3)
    writer.set_compression(rosbag2.CompressionMode.MESSAGE, rosbag2.CompressionFormat.ZSTD)
    ros2.fill(writer, stream(ros2))
    check(read_bag(tmp_path / "hall"))
    monkeypatch.setattr(unpacking, "LARGEST_BYTES", 60)
    with pytest.raises(InputError):
        read_bag(tmp_path / "hall")


@pytest.mark.parametrize(
    "computed",
    [
        "CREATE VIEW more AS SELECT 1",
        "CREATE TABLE large (x, data GENERATED ALWAYS AS (zeroblob(1000000000)))",
    ],
    ids=["view", "computed column"],
)
def test_a_database_that_computes_is_refused(computed, ros2, tmp_path):
    with pytest.raises(InputError):
        read_bag(edit(ros2.write(tmp_path / "hall", stream(ros2)), computed))
