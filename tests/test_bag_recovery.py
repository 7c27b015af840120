"""Bags that were cut, killed, re-indexed or compressed, in every storage: read as far as they go."""

import shutil
import sqlite3
import struct
import warnings
from contextlib import closing

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType, Writer
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores

from pedpred.command.recordings import OpenOptions, open_scene
from pedpred.errors import InputError
from pedpred.ros import is_bag, read_bag
from tests.bags import PEOPLE, Store

MCAP, SQLITE = rosbag2.StoragePlugin.MCAP, rosbag2.StoragePlugin.SQLITE3
COUNT = 60
_INDEX_POS = struct.Struct("<Q")


def people(store, count=COUNT):
    """One person who walks along x, 0.1 m in each tenth of a second."""
    for step in range(count):
        header = store.header(step / 10, "map")
        one = store._one("people_msgs/msg/Person", 3, store.pose(step / 10, 0.0), header)
        yield "/people", PEOPLE, store.make(PEOPLE, header=header, people=[one])


def write(kind, folder, count=COUNT):
    """Write a bag; its one file."""
    if kind in ("none", "bz2", "lz4"):
        store, path = Store(Stores.ROS1_NOETIC), folder / "hall.bag"
        writer = rosbag1.Writer(path)
        writer.chunk_threshold = 2000
        if kind != "none":
            writer.set_compression(rosbag1.Writer.CompressionFormat[kind.upper()])
        store.fill(writer, people(store, count))
        return path
    store = Store(Stores.ROS2_HUMBLE)
    store.write(folder / "hall", people(store, count), {"mcap": MCAP, "db3": SQLITE}[kind])
    return folder / "hall" / f"hall.{kind}"


def walked(scene):
    """How many detections there are; they are the first ones."""
    found = scene.trajectories
    np.testing.assert_allclose(found.time_s, np.arange(len(found)) / 10, atol=1e-6)
    np.testing.assert_allclose(found.position[:, 0], np.arange(len(found)) / 10, atol=1e-6)
    return len(found)


@pytest.mark.parametrize("kind", ["none", "bz2", "lz4", "db3", "mcap"])
def test_a_bag_that_is_cut_anywhere_is_read_up_to_there(kind, tmp_path):
    """Or refused, where nothing is left; it never says less than a shorter one, and always that it is cut."""
    total = 400 if kind == "db3" else COUNT
    path = write(kind, tmp_path, total)
    raw, found = path.read_bytes(), []
    for share in np.linspace(0.05, 0.999, 12):
        path.write_bytes(raw[: int(share * len(raw))])
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            try:
                found.append(walked(read_bag(path)))
                assert kind == "db3" or "read up to byte" in str(said[0].message)
                assert found[-1] == total or "is cut" in str(said[0].message)
            except InputError as error:
                assert error.path == path  # noqa: PT017
                found.append(0)
    assert np.diff(found).min() >= 0
    assert len(set(found)) > 3
    assert found[-1] > 0.9 * total


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_chunk_that_is_cut_is_read_up_to_the_cut(compression, tmp_path):
    """Recorders fill chunks of some hundred kB, in which people alone are there for minutes."""
    store, path, noise = Store(Stores.ROS2_HUMBLE), tmp_path / "hall.mcap", np.random.default_rng(0)
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=2**22, compression=compression)
        writer.start("ros2")
        text = store.types.generate_msgdef(PEOPLE, ros_version=2)[0].encode()
        kind = writer.register_schema(PEOPLE, "ros2msg", text)
        channels = [writer.register_channel(topic, "cdr", kind) for topic in ("/people", "/noise")]
        for count, (_, _, message) in enumerate(people(store, 1000)):
            writer.add_message(channels[0], count, bytes(store.types.serialize_cdr(message, PEOPLE)), count)
            writer.add_message(channels[1], count, noise.bytes(500), count)
        writer.finish()
    raw = path.read_bytes()
    path.write_bytes(raw[: int(0.6 * len(raw))])
    with pytest.warns(UserWarning, match="is cut: read up to byte .* what is whole of the chunk"):
        assert 450 < walked(read_bag(path, "/people")) < 650


def unclosed(path, chunk_known):
    """What a killed `rosbag record` leaves: no index, and the length of the last chunk not written."""
    raw = path.read_bytes()
    (index,) = _INDEX_POS.unpack_from(raw, raw.index(b"index_pos=") + len(b"index_pos="))
    raw = bytearray(raw[:index])
    _INDEX_POS.pack_into(raw, raw.index(b"index_pos=") + 10, 0)
    if not chunk_known:
        last = raw.rindex(b"compression=")
        (head,) = (at for at in range(last - 40, last) if _header_at(raw, at, last))
        (length,) = struct.unpack_from("<L", raw, head)
        struct.pack_into("<L", raw, head + 4 + length, 0)
        size = raw.index(b"size=", head) + 5
        struct.pack_into("<L", raw, size, 0)
    active = path.with_name("killed.bag.active")
    active.write_bytes(raw)
    return active


def _header_at(raw, at, inside):
    """Whether a record's header begins there that holds a place."""
    (length,) = struct.unpack_from("<L", raw, at)
    (field,) = struct.unpack_from("<L", raw, at + 4)
    return at + 8 <= inside < at + 4 + length < len(raw) and length < 100 and field < 40


@pytest.mark.parametrize("chunk_known", [True, False])
@pytest.mark.parametrize("kind", ["none", "bz2", "lz4"])
def test_a_bag_of_a_killed_recorder_is_read_without_an_index(kind, chunk_known, tmp_path):
    path = unclosed(write(kind, tmp_path), chunk_known)
    assert is_bag(path)
    with pytest.warns(UserWarning, match=r"was not closed: read up to byte \d+ of \d+"):
        scene = read_bag(path)
    assert walked(scene) == COUNT
    assert scene.name == "killed"


@pytest.mark.parametrize("kind", ["db3", "mcap"])
@pytest.mark.parametrize("about", [None, "", "reindexed"])
def test_a_folder_is_read_whatever_metadata_yaml_says_of_the_storage(kind, about, tmp_path, caplog):
    folder = write(kind, tmp_path).parent
    metadata = folder / "metadata.yaml"
    if about is None:
        metadata.unlink()
    else:
        text = metadata.read_text().replace("storage_identifier: sqlite3", "storage_identifier: mcap")
        metadata.write_text(about and text.replace("storage_identifier: mcap", "storage_identifier: ''"))
    assert is_bag(folder)
    assert walked(open_scene(folder)) == COUNT
    assert bool(about) or "no metadata.yaml" in caplog.text


def test_files_without_metadata_yaml_follow_in_the_order_of_their_numbers(tmp_path, caplog):
    whole = write("db3", tmp_path, 11)
    folder = tmp_path / "split"
    folder.mkdir()
    for step in range(11):
        part = shutil.copy(whole, folder / f"split_{step}.db3")
        with closing(sqlite3.connect(part)) as base:
            base.execute("DELETE FROM messages WHERE rowid != ?", (step + 1,))
            base.commit()
    assert walked(read_bag(folder)) == 11
    (folder / "split_11.db3").touch()  # the recorder was killed before it wrote there
    assert walked(read_bag(folder)) == 11
    assert "1 files are empty" in caplog.text


def test_a_folder_says_what_is_missing(tmp_path):
    path = write("mcap", tmp_path)
    path.rename(path.with_name("other.mcap"))
    with pytest.raises(InputError, match=r"metadata\.yaml: it names files that are missing.*Remove it"):
        read_bag(path.parent)
    (path.parent / "metadata.yaml").unlink()
    assert walked(read_bag(path.parent)) == COUNT


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_a_file_that_is_compressed_as_a_whole_is_unpacked(kind, tmp_path):
    path = write(kind, tmp_path)
    packed, metadata = path.with_name(f"{path.name}.zstd"), path.parent / "metadata.yaml"
    raw = zstandard.compress(path.read_bytes())
    packed.write_bytes(raw)
    path.unlink()
    text = (
        metadata.read_text()
        .replace(path.name, packed.name)
        .replace("compression_mode: ''", "compression_mode: file")
    )
    metadata.write_text(text.replace("compression_format: ''", "compression_format: zstd"))
    assert walked(read_bag(path.parent)) == COUNT
    assert is_bag(packed)
    assert walked(open_scene(packed)) == COUNT
    metadata.write_text(metadata.read_text().replace(packed.name, path.name))  # as some versions write
    assert walked(read_bag(path.parent)) == COUNT
    metadata.unlink()
    assert walked(open_scene(path.parent)) == COUNT
    packed.write_bytes(raw[: len(raw) // 2])
    with pytest.raises(InputError, match=str(path.parent)), warnings.catch_warnings(action="ignore"):
        read_bag(packed)


def test_a_file_that_would_fill_the_disk_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "hall.mcap.zstd"
    path.write_bytes(zstandard.compress(bytes(2**20)))
    monkeypatch.setattr("pedpred.ros.bag_files._LARGEST_BYTES", 1000)
    with pytest.raises(InputError, match=r"hall\.mcap\.zstd.*when unpacked"):
        read_bag(path)


def test_what_a_killed_recorder_left_in_the_write_ahead_log_is_read(tmp_path):
    """As with rosbag2's preset `resilient`."""
    whole, path = write("db3", tmp_path), tmp_path / "killed.db3"
    with closing(sqlite3.connect(whole)) as base:
        base.execute("PRAGMA journal_mode=WAL")
        rows = base.execute("SELECT * FROM messages ORDER BY rowid").fetchall()
        base.execute("DELETE FROM messages WHERE rowid > 20")
        base.commit()
        base.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        base.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", rows[20:])
        base.commit()
        shutil.copy(whole, path)
        shutil.copy(f"{whole}-wal", f"{path}-wal")
    assert walked(read_bag(path)) == COUNT


@pytest.mark.parametrize("raw", [b"", b"#ROSBAG V1.2\nold", b"nothing of this kind"])
def test_a_file_that_is_no_bag_is_told_so(raw, tmp_path):
    (tmp_path / "hall.bag").write_bytes(raw)
    with pytest.raises(InputError, match=r"hall\.bag.*begin with.*`rosbag fix`"):
        read_bag(tmp_path / "hall.bag")


def _walked_if_read(path):
    """How many detections of a bag are read; 0 where it is refused by name."""
    try:
        return walked(read_bag(path))
    except InputError as error:
        if str(path) not in str(error):
            raise
        return 0


@pytest.mark.parametrize("kind", ["none", "bz2", "lz4", "db3", "mcap"])
def test_zeros_in_place_of_the_end_are_a_cut(kind, tmp_path, caplog):
    """As a disk leaves them when the power fails: what is read are the first detections."""
    path = write(kind, tmp_path)
    raw = path.read_bytes()
    if (at := raw.find(b"index_pos=")) >= 0:
        raw = raw[: at + 10] + bytes(8) + raw[at + 18 :]  # not closed
    counts = []
    for share in (0.5, 0.7, 0.9):
        size = int(share * len(raw))
        path.write_bytes(raw[:size] + bytes(len(raw) - size))
        with warnings.catch_warnings(record=True, action="always") as told:
            counts.append(_walked_if_read(path))
        said = [str(one.message) for one in told] + caplog.messages
        assert counts[-1] in (0, COUNT) or any("is cut" in text or "damaged" in text for text in said)
    assert counts == sorted(counts)
    assert counts[-1] > COUNT / 4


@pytest.mark.parametrize("kind", ["none", "db3", "mcap"])
def test_damaged_messages_are_left_out_and_counted(kind, tmp_path, caplog):
    store = Store(Stores.ROS1_NOETIC if kind == "none" else Stores.ROS2_HUMBLE)
    serialise = store.types.serialize_ros1 if store.ros1 else store.types.serialize_cdr
    path = write(kind, tmp_path)
    raw, messages = path.read_bytes(), [bytes(serialise(one, PEOPLE)) for *_, one in people(store)]
    for row in (20, 40):
        raw = raw.replace(messages[row], bytes([255]) * len(messages[row]))
    path.write_bytes(raw)
    with caplog.at_level("WARNING"):
        found = read_bag(path).trajectories
    np.testing.assert_allclose(np.setdiff1d(np.arange(COUNT) / 10, found.time_s.round(6)), [2.0, 4.0])
    assert f"left out: 2 of {COUNT} messages, which are damaged" in caplog.text
    for message in messages:
        raw = raw.replace(message, bytes([255]) * len(message))
    path.write_bytes(raw)
    with pytest.raises(InputError, match=str(path)):
        read_bag(path)


@pytest.mark.parametrize("name", ["hall.bag.zst", "hall.bag.zstd", "hall.bag.active", "hall.bag.active.zst"])
def test_a_bag_of_ros_1_has_many_names(name, tmp_path):
    raw = write("none", tmp_path).read_bytes()
    (tmp_path / name).write_bytes(zstandard.compress(raw) if "zst" in name else raw)
    assert is_bag(tmp_path / name)
    assert walked(open_scene(tmp_path / name)) == COUNT


@pytest.mark.parametrize("topic", ["people", "/people"])
def test_a_topic_is_named_with_or_without_its_slash(topic, tmp_path):
    assert walked(open_scene(write("mcap", tmp_path), OpenOptions(topic=topic))) == COUNT


def test_another_data_base_is_no_damaged_bag(tmp_path):
    with closing(sqlite3.connect(tmp_path / "simulation.db3")) as base:
        base.execute("CREATE TABLE trajectory_data (frame, id, pos_x, pos_y)")
        base.commit()
    with pytest.raises(InputError, match=r"\['trajectory_data'\].*a name that ends in .sqlite"):
        read_bag(tmp_path / "simulation.db3")
