"""Bags of ROS 1 and ROS 2, in every storage and with every message of tracked people."""

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
from rosbags.typesys import Stores

from pedpred.command import main
from pedpred.command.recordings import open_scene
from pedpred.errors import InputError
from pedpred.ros import PEOPLE_FIELDS, read_bag, unpacking, write_recording
from pedpred.ros.definitions import EDITIONS
from pedpred.storage.scenes import read_scene, write_scene
from tests.bags import PEOPLE, Filled, Store, bag, check, repacked, stream, tracks_of, write_mcap
from tests.worlds import walled_scene

EVERY_EDITION = [
    (kind, number)
    for number, edition in enumerate(EDITIONS)
    for kind in sorted(PEOPLE_FIELDS)
    if kind in edition or not number
]


@pytest.mark.parametrize("kind", sorted(PEOPLE_FIELDS))
def test_people_of_every_type_are_read(kind, ros2, tmp_path):
    ros2.write(tmp_path / "hall", stream(ros2, kind))
    check(read_bag(tmp_path / "hall"), tracks_of(kind))


@pytest.mark.parametrize(("kind", "edition"), EVERY_EDITION)
@pytest.mark.parametrize("storage", ["mcap", "db3"])
def test_every_type_is_known_without_definitions(kind, edition, storage, tmp_path):
    """In every edition of its package: MCAP with empty schemas, and .db3 as Humble writes them."""
    store, path = Filled(edition), tmp_path / "hall.mcap"
    if storage == "mcap":
        write_mcap(store, path, kind, "cdr", "ros2msg", b"")
    else:
        store.write(tmp_path / "hall", stream(store, kind))
        path = tmp_path / "hall" / "hall.db3"
        with closing(sqlite3.connect(path)) as base:
            base.executescript("DROP TABLE message_definitions; UPDATE schema SET schema_version = 3;")
    has_ids = edition < 2 or "vision" not in kind
    check(read_bag(path), tracks_of(kind if has_ids else "geometry_msgs/msg/PoseArray"))


def test_an_empty_definition_does_not_count(tmp_path):
    """As rosbag2 writes where a package is not installed."""
    store = Filled(0)
    store.write(tmp_path / "hall", stream(store, PEOPLE))
    with closing(sqlite3.connect(tmp_path / "hall" / "hall.db3")) as base:
        base.execute("UPDATE message_definitions SET encoding = 'unknown', encoded_message_definition = ''")
        base.commit()
    check(read_bag(tmp_path / "hall"))


@pytest.mark.parametrize("defined", [True, False])
def test_messages_of_ros_1_in_mcap_are_read(defined, tmp_path):
    """As `mcap convert` writes."""
    store, text = Filled(0, ros1=True), b"yes" if defined else b""
    check(read_bag(write_mcap(store, tmp_path / "hall.mcap", PEOPLE, "ros1", "ros1msg", text)))


def test_another_encoding_is_refused(tmp_path):
    path = write_mcap(Filled(0), tmp_path / "hall.mcap", PEOPLE, "json", "jsonschema", b"")
    with pytest.raises(InputError) as error:
        read_bag(path)
    assert "json" in error.value.problem


def test_every_storage_is_read(ros2, tmp_path):
    old = Store(Stores.ROS1_NOETIC)
    old.write(tmp_path / "hall.bag", stream(old, PEOPLE))
    ros2.write(tmp_path / "hall", stream(ros2, PEOPLE), rosbag2.StoragePlugin.MCAP)
    check(read_bag(tmp_path / "hall.bag"))
    check(read_bag(tmp_path / "hall"))
    check(read_bag(next((tmp_path / "hall").glob("*.mcap")), "/tracks"))


@pytest.mark.parametrize(
    "fields",
    ["tracks,id=track_id,position=pose.pose.position", "tracks , id=track_id,position=pose.pose.position"],
)
def test_people_of_any_type_are_read_by_their_fields(fields, ros2, tmp_path):
    """Here as if the type were not known; positions alone are assigned."""
    ros2.write(tmp_path / "hall", stream(ros2, "spencer_tracking_msgs/msg/TrackedPersons"))
    check(read_bag(tmp_path / "hall", "/tracks", fields=fields))
    check(read_bag(tmp_path / "hall", "/tracks", fields=fields.replace("id=track_id,", "")), (1, 2))


def test_the_command_reads_people_by_their_fields(ros2, tmp_path, capsys):
    ros2.write(tmp_path / "hall", stream(ros2, "hunav_msgs/msg/Agents"))
    fields = "agents,id=id,position=position.position"
    hall = str(tmp_path / "hall")
    main(["info", hall, "--topic", "/tracks", "--people", fields, "--identities", "assigned"])
    assert "6 of 2 tracks" in capsys.readouterr().out


@pytest.mark.parametrize("field", ["agents,position=place", "nobody,position=position", "id,position=x"])
def test_a_field_that_is_missing_is_named(field, ros2, tmp_path):
    ros2.write(tmp_path / "hall", stream(ros2, "hunav_msgs/msg/Agents"))
    with pytest.raises(InputError) as error:
        read_bag(tmp_path / "hall", "/tracks", fields=field)
    assert "agents" in str(error.value) or "position" in str(error.value)


def test_a_bag_becomes_a_scene_folder_with_another_map(ros2, tmp_path):
    world = walled_scene(np.random.default_rng(0))
    write_scene(world, tmp_path / "room")
    ros2.write(tmp_path / "hall", stream(ros2, "hunav_msgs/msg/Agents"))
    hall, scene, room = (str(tmp_path / name) for name in ("hall", "scene", "room"))
    main(["convert", hall, "-o", scene, "--map", room])
    scene = read_scene(tmp_path / "scene")
    assert scene.trajectories.track_id.tolist() == [3, 8] * 3
    np.testing.assert_array_equal(scene.occupancy.occupied, world.occupancy.occupied)


def test_a_recording_that_is_read_as_a_bag_has_its_people(tmp_path):
    scene = walled_scene(np.random.default_rng(0), detections=20)
    write_recording(scene, tmp_path / "hall.mcap")
    found = open_scene(tmp_path / "hall.mcap")
    np.testing.assert_array_equal(found.trajectories.track_id, scene.trajectories.track_id)
    np.testing.assert_array_equal(found.trajectories.position, scene.trajectories.position)
    np.testing.assert_array_equal(found.occupancy.occupied, scene.occupancy.occupied)


def test_a_bag_that_makes_no_scene_is_refused(ros2, tmp_path):
    kind = "hunav_msgs/msg/Agents"
    ros2.write(tmp_path / "empty", [("/map", "nav_msgs/msg/OccupancyGrid", ros2.grid())])
    ros2.write(tmp_path / "two", [*stream(ros2, kind), ("/more", kind, ros2.people(kind, 0.5))])
    ros2.write(tmp_path / "moved", stream(ros2, kind, "odom"))
    (tmp_path / "torn.bag").write_bytes(b"#ROSBAG V2.0\nnothing")
    (tmp_path / "old.bag").write_bytes(b"#ROSBAG V1.2\nold")
    remedies = {
        "empty": "--people",
        "two": "--topic",
        "moved": "--transform",
        "torn.bag": "rosbag reindex",
        "old.bag": "rosbag fix",
    }
    for name, remedy in remedies.items():
        with pytest.raises(InputError) as error:
            read_bag(tmp_path / name)
        assert name in str(error.value)
        assert remedy in str(error.value)
    check(read_bag(tmp_path / "two", "/tracks"))


# Order and time


def walk(start_s, count=40):
    return [(start_s + k / 10, {"3": (k / 10, 1.0), "8": (9.0, k / 10)}) for k in range(count)]


def test_messages_that_come_late_are_sorted(ros2, tmp_path):
    steps = walk(100.0)
    steps[5], steps[6], steps[20], steps[28] = steps[6], steps[5], steps[28], steps[20]
    people = read_bag(bag(ros2, tmp_path / "hall", *steps)).trajectories
    np.testing.assert_allclose(people.position[people.track_id == 3, 0], np.arange(40) / 10)


def test_a_recording_that_restarts_is_refused(ros2, tmp_path):
    with pytest.raises(InputError) as error:
        read_bag(bag(ros2, tmp_path / "hall", *walk(100.0), *walk(100.0)))
    assert "split" in str(error.value)


def test_times_without_stamps_are_those_of_the_bag(ros2, tmp_path):
    steps = [(0.0, people) for _, people in walk(100.0)]
    people = read_bag(bag(ros2, tmp_path / "hall", *steps)).trajectories
    np.testing.assert_allclose(np.unique(people.time_s), np.arange(1, 41) / 1e9)


def test_times_that_are_no_seconds_are_refused(ros2, tmp_path):
    steps = [(100.0 * k, {"3": (0.1 * k, 0.0)}) for k in range(20)]
    with pytest.raises(InputError):
        read_bag(bag(ros2, tmp_path / "hall", *steps))


# Sizes


@pytest.mark.parametrize("compression", list(CompressionType))
def test_chunks_may_be_compressed_in_every_way(compression, tmp_path):
    world = walled_scene(np.random.default_rng(0), detections=20)
    write_recording(world, tmp_path / "zstd.mcap")
    repacked(tmp_path / "zstd.mcap", tmp_path / "hall.mcap", compression)
    found = read_bag(tmp_path / "hall.mcap").trajectories.track_id
    np.testing.assert_array_equal(found, world.trajectories.track_id)


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
@pytest.mark.parametrize("honest", [True, False])
def test_a_chunk_that_would_fill_the_memory_is_refused(compression, honest, tmp_path):
    """Whether it declares its size or not; half a gigabyte of zeros is half a megabyte of lz4."""
    held = 2**29
    squeezed = {"lz4": lz4_of_zeros, "zstd": zstd_of_zeros}
    with (tmp_path / "bomb.mcap").open("wb") as file:
        file.write(MCAP0_MAGIC)
        builder = RecordBuilder()
        Header("ros2", "").write(builder)
        Chunk(compression, squeezed[compression](held), 0, 0, 0, held if honest else 1).write(builder)
        file.write(builder.end())
        file.write(MCAP0_MAGIC)
    with pytest.raises(InputError) as error:
        read_bag(tmp_path / "bomb.mcap")
    assert f"at most {unpacking.LARGEST_CHUNK_BYTES} bytes" in str(error.value)


COMPRESSED = {
    "bz2": (Stores.ROS1_NOETIC, (rosbag1.Writer.CompressionFormat.BZ2,)),
    "lz4": (Stores.ROS1_NOETIC, (rosbag1.Writer.CompressionFormat.LZ4,)),
    "zstd": (Stores.ROS2_HUMBLE, (rosbag2.CompressionMode.MESSAGE, rosbag2.CompressionFormat.ZSTD)),
}


@pytest.mark.parametrize("kind", COMPRESSED)
def test_chunks_and_messages_are_unpacked_within_the_bound(kind, tmp_path, monkeypatch):
    path = tmp_path / ("hall" if kind == "zstd" else "hall.bag")
    version, compression = COMPRESSED[kind]
    store = Store(version)
    ros2 = {"version": 9, "storage_plugin": rosbag2.StoragePlugin.SQLITE3}
    writer = rosbag1.Writer(path) if store.ros1 else rosbag2.Writer(path, **ros2)
    writer.set_compression(*compression)
    store.fill(writer, stream(store, PEOPLE))
    check(read_bag(path))
    monkeypatch.setattr(unpacking, "LARGEST_CHUNK_BYTES", 60)
    with pytest.raises(InputError) as error:
        read_bag(path)
    assert "at most 60 bytes" in str(error.value)


def lz4_of_zeros(count):
    packer, block = LZ4FrameCompressor(), bytes(2**22)
    return packer.begin() + b"".join(packer.compress(block) for _ in range(count // 2**22)) + packer.flush()


def zstd_of_zeros(count):
    packer, block = zstandard.ZstdCompressor().compressobj(size=count), bytes(2**22)
    return b"".join(packer.compress(block) for _ in range(count // 2**22)) + packer.flush()


@pytest.mark.parametrize(
    "computed",
    [
        "CREATE VIEW more AS SELECT 1",
        "CREATE TABLE large (x, data GENERATED ALWAYS AS (zeroblob(1000000000)))",
    ],
    ids=["view", "computed column"],
)
def test_a_database_that_computes_is_refused(computed, ros2, tmp_path):
    """A view may be searched for ever."""
    ros2.write(tmp_path / "hall", stream(ros2, PEOPLE))
    with closing(sqlite3.connect(tmp_path / "hall" / "hall.db3")) as base:
        base.execute(computed)
        base.commit()
    with pytest.raises(InputError) as error:
        read_bag(tmp_path / "hall")
    assert "computed" in str(error.value)
