"""Bags that were cut, killed, re-indexed or compressed: read as far as they go, or what repairs them."""

import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType
from rosbags import rosbag2

from pedpred.command.recordings import open_scene
from pedpred.errors import InputError
from pedpred.ros import is_bag, read_bag
from tests.bags import PEOPLE, Store, repacked
from tests.refused import unread

COUNT = 60


def people(store, count=COUNT):
    """One person who walks along x, 0.1 m in each tenth of a second."""
    for step in range(count):
        yield "/people", PEOPLE, store.people(PEOPLE, step / 10, {3: (step / 10, 0.0)})


def write(kind, folder, count=COUNT):
    """Write a bag; its one file."""
    if kind == "bag":
        store = Store(ros1=True)
        return store.write(folder / "hall.bag", people(store, count))
    storage = {"mcap": rosbag2.StoragePlugin.MCAP, "db3": rosbag2.StoragePlugin.SQLITE3}[kind]
    return Store().write(folder / "hall", people(Store(), count), storage) / f"hall.{kind}"


def walked(scene):
    """How many detections there are; they are the first ones."""
    found = scene.trajectories
    np.testing.assert_allclose(found.time_s, np.arange(len(found)) / 10, atol=1e-6)
    np.testing.assert_allclose(found.position[:, 0], np.arange(len(found)) / 10, atol=1e-6)
    return len(found)


def test_an_mcap_file_that_is_cut_is_read_up_to_there(tmp_path, caplog):
    """Or refused, where nothing is left."""
    whole, path, found = write("mcap", tmp_path, 400), tmp_path / "cut.mcap", []
    repacked(whole, path, CompressionType.ZSTD, chunk_size=2000)
    raw = path.read_bytes()
    for share in (0.05, 0.2, 0.5, 0.8, 0.999):
        path.write_bytes(raw[: int(share * len(raw))])
        caplog.clear()
        try:
            found.append(walked(read_bag(path)))
            assert len(caplog.messages) == 1
        except InputError:
            found.append(0)
    assert found == sorted(found)
    assert len(set(found)) > 3
    assert found[-1] == 400


@pytest.mark.parametrize(
    ("kind", "remedy"), [("bag", "rosbag reindex"), ("db3", ".recover"), ("mcap", "mcap recover")]
)
def test_another_damaged_file_is_refused_with_what_repairs_it(kind, remedy, tmp_path):
    path = write(kind, tmp_path, 400)
    if kind == "mcap":  # with checksums
        repacked(path, path := tmp_path / "hall.mcap", CompressionType.NONE)
    raw = path.read_bytes()
    half = len(raw) // 2
    path.write_bytes(raw[:half] + (bytes(500) + raw[half + 500 :] if kind == "mcap" else b""))
    with unread(path, remedy=remedy):
        read_bag(path)


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_a_folder_is_read_whatever_metadata_yaml_says(kind, tmp_path):
    """A killed recorder writes none, or an empty one; `ros2 bag reindex` names no storage."""
    folder = write(kind, tmp_path).parent
    (folder / "metadata.yaml").unlink()
    assert walked(read_bag(folder)) == COUNT
    for about in ("", "storage_identifier: ''"):
        (folder / "metadata.yaml").write_text(about)
        assert is_bag(folder)
        assert walked(read_bag(folder)) == COUNT
    next(folder.glob("hall.*")).unlink()
    assert not is_bag(folder)
    with unread(folder):
        read_bag(folder)


def test_files_follow_in_the_order_of_their_numbers(tmp_path, caplog):
    whole = write("db3", tmp_path, 11)
    folder = tmp_path / "split"
    folder.mkdir()
    for step in range(11):
        part = shutil.copy(whole, folder / f"split_{step}.db3")
        with closing(sqlite3.connect(part)) as base:
            base.execute("DELETE FROM messages WHERE rowid != ?", (step + 1,))
            base.commit()
    (folder / "split_11.db3").touch()  # the recorder was killed before it wrote there
    assert walked(read_bag(folder)) == 11
    assert len(caplog.records) == 1


@pytest.mark.parametrize("kind", ["db3", "mcap", "bag"])
def test_a_file_that_is_compressed_as_a_whole_is_unpacked(kind, tmp_path, monkeypatch):
    path = write(kind, tmp_path)
    packed = path.with_name(f"{path.name}.zstd")
    packed.write_bytes(zstandard.compress(path.read_bytes()))
    if kind != "bag":
        assert walked(read_bag(path.parent)) == COUNT  # both are there
        path.unlink()
        assert walked(read_bag(path.parent)) == COUNT
    scene = open_scene(packed)
    assert (walked(scene), scene.name) == (COUNT, "hall")
    for limit in ("BYTES", "RATIO"):  # then it would fill the disk
        monkeypatch.setattr(f"pedpred.ros.bag_files._LARGEST_{limit}", 1)
    with unread(packed):
        read_bag(packed)


def test_a_write_ahead_log_is_read(tmp_path):
    """As a killed recorder leaves it with rosbag2's preset `resilient`."""
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


@pytest.mark.parametrize("kind", ["bag", "db3", "mcap"])
def test_damaged_messages_are_left_out_and_counted(kind, tmp_path, caplog):
    store, path = Store(ros1=kind == "bag"), write(kind, tmp_path)
    raw, messages = path.read_bytes(), [store.raw(PEOPLE, one) for *_, one in people(store)]
    for row in (20, 40):
        raw = raw.replace(messages[row], bytes([255]) * len(messages[row]))
    path.write_bytes(raw)
    found = read_bag(path).trajectories
    np.testing.assert_allclose(np.setdiff1d(np.arange(COUNT) / 10, found.time_s.round(6)), [2.0, 4.0])
    assert f"2 of {COUNT}" in caplog.text
    for message in messages:
        raw = raw.replace(message, bytes([255]) * len(message))
    path.write_bytes(raw)
    with unread(path):
        read_bag(path)
