"""Feature shards: a disk round trip changes nothing; damage is named."""

import dataclasses
import json
import re
import weakref

import matplotlib
import matplotlib.pyplot
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from PIL import Image

from pedpred.datasets.rows import load_sequences
from pedpred.errors import InputError
from pedpred.features import extract, extract_blocks
from pedpred.models.lstm.features import LstmFeatures
from pedpred.models.lstm.features.grids import unpack_crops
from pedpred.storage.columns import read_columns, split_pairs, write_blocks, write_columns
from pedpred.storage.scenes import write_scene
from pedpred.storage.shards import (
    FEATURE_SCHEMA,
    read_crops,
    read_manifest,
    read_shard,
    read_shard_blocks,
    write_embeddings,
    write_manifest,
    write_shard,
)
from tests.conftest import ROOT
from tests.exported import LSTM_ROWS
from tests.worlds import tracked, walled_scene

SIZES = LSTM_ROWS.protocol, LSTM_ROWS.features


def stored(table):
    """Columns and inputs."""
    return {**table.columns, **table.inputs}


def walled(seed=0, **options):
    scene = walled_scene(np.random.default_rng(seed), **options)
    return scene, tracked(scene)


@pytest.fixture(scope="module")
def table():
    return extract(*walled(), *SIZES, phase_offsets=3)


@pytest.fixture
def folder(tmp_path):
    scene, tracks = walled()
    write_shard(extract_blocks(scene, tracks, *SIZES, rows=350, phase_offsets=3), tmp_path, "walled")
    write_scene(scene, tmp_path / "scene")
    write_manifest(tmp_path, LSTM_ROWS, {"walled": tmp_path / "scene"})
    return tmp_path


def test_round_trip_changes_nothing(folder, table):
    made_with, shards = read_manifest(folder)
    assert made_with == LSTM_ROWS
    assert list(shards) == ["walled"]
    back = read_shard(folder, "walled", made_with)
    for name, column in stored(table).items():
        np.testing.assert_array_equal(column, stored(back)[name], err_msg=name)
        assert column.dtype == stored(back)[name].dtype, name


def test_writing_twice_gives_the_same_bytes(folder, tmp_path):
    write_shard(extract_blocks(*walled(), *SIZES, rows=350, phase_offsets=3), tmp_path / "again", "walled")
    assert (tmp_path / "again/walled.parquet").read_bytes() == (folder / "walled.parquet").read_bytes()


def test_a_row_group_holds_whole_tracks(folder, table):
    blocks = list(read_shard_blocks(folder, "walled", LSTM_ROWS))
    assert len(blocks) == pq.ParquetFile(folder / "walled.parquet").num_row_groups > 1
    owners = [set(block.track_id.tolist()) for block in blocks]
    assert sum(map(len, owners)) == len(np.unique(table.track_id))
    crops = np.concatenate(list(read_crops(folder, "walled", LSTM_ROWS)))
    np.testing.assert_array_equal(crops, table.inputs["occupancy"])


def test_a_scene_of_nobody_survives(tmp_path):
    scene, _ = walled()
    nobody = dataclasses.replace(scene, trajectories=scene.trajectories.select(np.arange(0)))
    write_shard([extract(nobody, tracked(nobody), *SIZES)], tmp_path, "nobody")
    assert len(read_shard(tmp_path, "nobody", LSTM_ROWS)) == 0


def test_a_block_is_let_go_when_the_next_one_comes(table, tmp_path):
    """However long a scene is, at most two blocks of it are in memory, written or read."""
    alive, most = [], 0

    def watched(blocks):
        nonlocal most
        for block in blocks:
            alive.append(weakref.ref(block.inputs["occupancy"]))
            most = max(most, sum(reference() is not None for reference in alive))
            yield block
            del block

    copies = (table.select(np.arange(len(table))) for _ in range(8))
    write_shard(watched(copies), tmp_path, "long")
    assert most <= 2
    alive, most = [], 0
    read = watched(read_shard_blocks(tmp_path, "long", LSTM_ROWS))
    assert sum(len(block) for block in read) == 8 * len(table)
    assert most <= 2


def test_pandas_reads_it(folder, table):
    frame = pd.read_parquet(folder / "walled.parquet")
    assert len(frame) == len(table)
    assert len(frame.occupancy[0]) == 450
    np.testing.assert_array_equal(frame.angular_grid[3], table.inputs["angular_grid"][3])


def test_half_floats_survive(tmp_path):
    embeddings = np.random.default_rng(0).normal(size=(7, 392)).astype(np.float16)
    write_embeddings([embeddings[:3], embeddings[3:]], tmp_path, "a")
    found = read_columns(tmp_path / "a.parquet", {"embedding": (-1,)})["embedding"]
    np.testing.assert_array_equal(found, embeddings)


def test_damage_is_named(folder):
    path = folder / "walled.parquet"
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"walled\.parquet.*Write it again"):
        read_shard(folder, "walled", LSTM_ROWS)
    path.write_bytes(whole[:5000] + bytes(1000) + whole[6000:])
    with pytest.raises(InputError, match=r"walled\.parquet, file"):
        read_shard(folder, "walled", LSTM_ROWS)
    write_blocks([{"track_id": np.arange(3)}], path, FEATURE_SCHEMA)
    with pytest.raises(InputError, match="column phase"):
        read_shard(folder, "walled", LSTM_ROWS)
    about = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps(about | {"schema": 99}))
    with pytest.raises(InputError, match="schema"):
        read_manifest(folder)
    (folder / "manifest.json").unlink()
    with pytest.raises(InputError, match=r"manifest\.json"):
        read_manifest(folder)


def test_another_size_is_named(folder):
    with pytest.raises(InputError, match="angular_grid"):
        read_shard(folder, "walled", dataclasses.replace(LSTM_ROWS, features=LstmFeatures(angular_cells=36)))


@pytest.mark.parametrize("wrong", [str, np.float32])
@pytest.mark.parametrize("column", ["time_s", "angular_grid", "future_steps"])
def test_another_type_is_named(folder, table, column, wrong):
    columns = split_pairs(stored(table))
    columns[column] = columns[column].astype(wrong if column != "angular_grid" else np.float64)
    write_blocks([columns], folder / "walled.parquet", FEATURE_SCHEMA)
    with pytest.raises(InputError, match=rf"walled\.parquet, column {column}.*Write it again"):
        read_shard(folder, "walled", LSTM_ROWS)


def test_another_schema_version_is_named(folder, table):
    for write in (write_columns, lambda c, p: write_blocks([c], p, FEATURE_SCHEMA - 1)):
        write(split_pairs(stored(table)), folder / "walled.parquet")
        with pytest.raises(InputError, match=r"walled\.parquet, schema: version .* expected"):
            read_shard(folder, "walled", LSTM_ROWS)


def test_the_manifest_describes_every_column_and_changes_with_the_scene(folder):
    about = json.loads((folder / "manifest.json").read_text())
    assert set(about["columns"]) == set(pd.read_parquet(folder / "walled.parquet").columns)
    assert about["protocol"]["dt_s"] == LSTM_ROWS.protocol.dt_s
    (folder / "scene/map.pgm").write_bytes(b"another map")
    write_manifest(folder, LSTM_ROWS, {"walled": folder / "scene"})
    assert json.loads((folder / "manifest.json").read_text())["shards"] != about["shards"]


def test_codes_must_belong_to_the_features(folder, table):
    write_embeddings([np.zeros((len(table) - 1, 392), np.float16)], folder / "embeddings", "walled")
    with pytest.raises(InputError, match="rows"):
        load_sequences({"a": folder}, {"a": folder / "embeddings"})
    write_embeddings([np.ones((len(table), 392), np.float16)], folder / "embeddings", "walled")
    data = load_sequences({"a": folder}, {"a": folder / "embeddings"})
    assert len(data.spans) == 3 * len(np.unique(table.track_id))
    assert set(data.spans.track) == set(table.track_id)


def test_the_example_in_the_documentation_draws_a_grid_and_an_angular_grid(table, tmp_path, monkeypatch):
    matplotlib.use("Agg")
    write_shard([table], tmp_path / "data/features/real/eth", "eth")
    monkeypatch.chdir(tmp_path)
    examples = re.findall(r"```python\n(.*?)```", (ROOT / "docs/ablations.md").read_text(), re.DOTALL)
    (example,) = (code for code in examples if "read_parquet" in code)
    names: dict = {}
    exec(example, names)
    drawn = names["row"]
    expected = unpack_crops(table.inputs["occupancy"][drawn.name : drawn.name + 1], 60)[0]
    np.testing.assert_array_equal(names["grid"], expected)
    with Image.open("inputs.png") as picture:
        assert len(picture.convert("L").getcolors()) > 2
    matplotlib.pyplot.close("all")
