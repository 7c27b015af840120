"""Feature shards: a disk round trip changes nothing; damage is named."""

import dataclasses
import json

import numpy as np
import pandas as pd
import pytest

from pedpred.datasets.motion import load_motion_data
from pedpred.errors import StorageError
from pedpred.features import FeatureSettings, extract
from pedpred.storage.columns import read_columns, write_columns
from pedpred.storage.shards import read_manifest, read_shard, write_codes, write_manifest, write_shard
from pedpred.tracking import KalmanSettings, follow
from tests.worlds import walled_scene

SETTINGS = FeatureSettings(clocks=3)


@pytest.fixture
def shard(tmp_path):
    scene = walled_scene(np.random.default_rng(0))
    tracks = follow(scene.recording, "kalman", KalmanSettings(0.1, 0.1), 0.2)
    table = extract(scene, tracks, SETTINGS)
    write_shard(table, tmp_path, "walled")
    (tmp_path / "source").write_bytes(b"tracks")
    write_manifest(tmp_path, SETTINGS, {"walled": tmp_path / "source"})
    return tmp_path, table


def test_round_trip_changes_nothing(shard):
    folder, table = shard
    settings, names = read_manifest(folder)
    assert settings == SETTINGS
    assert names == ["walled"]
    back = read_shard(folder, "walled", settings)
    for field in dataclasses.fields(table):
        before, after = getattr(table, field.name), getattr(back, field.name)
        assert before.dtype == after.dtype, field.name
        np.testing.assert_array_equal(before, after, err_msg=field.name)


def test_writing_twice_gives_the_same_bytes(shard, tmp_path):
    folder, table = shard
    write_shard(table, tmp_path / "again", "walled")
    assert (tmp_path / "again/walled.parquet").read_bytes() == (folder / "walled.parquet").read_bytes()


def test_pandas_reads_it(shard):
    folder, table = shard
    frame = pd.read_parquet(folder / "walled.parquet")
    assert len(frame) == len(table)
    assert len(frame.occupancy[0]) == 450
    np.testing.assert_array_equal(frame.angular_grid[3], table.angular_grid[3])


def test_half_floats_survive(tmp_path):
    codes = np.random.default_rng(0).normal(size=(7, 392)).astype(np.float16)
    write_codes(codes, tmp_path, "a")
    np.testing.assert_array_equal(read_columns(tmp_path / "a.parquet", {"code": (-1,)})["code"], codes)


def test_damage_is_named(shard):
    folder, _ = shard
    path = folder / "walled.parquet"
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(StorageError, match=r"walled\.parquet.*dvc repro"):
        read_shard(folder, "walled", SETTINGS)
    write_columns({"track_id": np.arange(3)}, path)
    with pytest.raises(StorageError, match="column clock"):
        read_shard(folder, "walled", SETTINGS)
    about = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps(about | {"schema": 99}))
    with pytest.raises(StorageError, match="schema"):
        read_manifest(folder)
    (folder / "manifest.json").unlink()
    with pytest.raises(StorageError, match=r"manifest\.json"):
        read_manifest(folder)


def test_another_size_is_named(shard):
    folder, _ = shard
    with pytest.raises(StorageError, match="angular_grid"):
        read_shard(folder, "walled", dataclasses.replace(SETTINGS, angular_cells=36))


def test_codes_must_belong_to_the_features(shard):
    folder, table = shard
    write_codes(np.zeros((len(table) - 1, 392), np.float16), folder / "codes", "walled")
    with pytest.raises(StorageError, match="rows"):
        load_motion_data(folder, folder / "codes")
    write_codes(np.ones((len(table), 392), np.float16), folder / "codes", "walled")
    data = load_motion_data(folder, folder / "codes")
    assert len(data.sequences) == 3 * len(np.unique(table.track_id))
    assert set(data.track) == set(range(len(np.unique(table.track_id))))
