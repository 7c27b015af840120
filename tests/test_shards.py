"""Feature shards: a disk round trip changes nothing; damage is named."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pedpred.datasets.rows import load_rows
from pedpred.errors import InputError
from pedpred.features import ForecastProtocol, extract_blocks
from pedpred.models.features import RowFormat
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.rows.files import (
    SCHEMA,
    columns_of,
    count_rows_of,
    read_crops,
    read_manifest,
    read_shard,
    scene_digest,
    step_columns,
    write_embeddings,
    write_manifest,
    write_shard,
)
from pedpred.storage.columns import read_columns, write_blocks
from pedpred.storage.scenes import write_scene
from tests.exported import LSTM_ROWS
from tests.refused import unread
from tests.worlds import extract, tracked, walled_scene

SIZES = LSTM_ROWS.protocol, LSTM_ROWS.features


INSTANTS = RowFormat(
    ForecastProtocol(horizon_steps=4), "mixture", MixtureFeatures(beams=8, neighbours=2, history_steps=3)
)


def read_whole(folder, name, row_format=LSTM_ROWS):
    """All columns of a file."""
    blocks = list(read_shard(folder, name, row_format))
    return {key: np.concatenate([block[key] for block in blocks]) for key in blocks[0]}


def write_steps(blocks, folder, name):
    write_shard(map(step_columns, blocks), folder, name, LSTM_ROWS)


def walled(seed=0, **options):
    scene = walled_scene(np.random.default_rng(seed), **options)
    return scene, tracked(scene)


@pytest.fixture(scope="module")
def table():
    return extract(*walled(), *SIZES, phase_offsets=3)


@pytest.fixture
def folder(tmp_path):
    scene, tracks = walled()
    write_steps(extract_blocks(scene, tracks, *SIZES, rows=350, phase_offsets=3), tmp_path, "walled")
    write_scene(scene, tmp_path / "scene")
    write_manifest(tmp_path, LSTM_ROWS, {"walled": scene_digest(tmp_path / "scene")})
    return tmp_path


def test_round_trip_changes_nothing(folder, table):
    back, written = read_whole(folder, "walled"), step_columns(table)
    assert list(back) == list(columns_of(LSTM_ROWS))
    for name, column in back.items():
        np.testing.assert_array_equal(column, written[name], err_msg=name)
        assert column.dtype == written[name].dtype, name


def test_a_row_group_holds_whole_tracks(folder, table):
    blocks = list(read_shard(folder, "walled", LSTM_ROWS))
    assert len(blocks) == pq.ParquetFile(folder / "walled.parquet").num_row_groups > 1
    owners = [set(block["track_id"].tolist()) for block in blocks]
    assert sum(map(len, owners)) == len(np.unique(table.track_id))
    crops = np.concatenate(list(read_crops(folder, "walled", LSTM_ROWS)))
    np.testing.assert_array_equal(crops, table.inputs["occupancy"])


@pytest.mark.parametrize("count", [0, 30])
def test_instants_survive_the_disk_exactly(tmp_path, count):
    rng = np.random.default_rng(0)
    rows = {
        name: rng.normal(0, 5, (count, *about.shape)).astype(about.dtype)
        for name, about in columns_of(INSTANTS).items()
    }
    for name in ("corridor_0", "again"):
        write_shard([rows], tmp_path, name, INSTANTS)
    back = read_whole(tmp_path, "corridor_0", INSTANTS)
    for name, values in rows.items():
        np.testing.assert_array_equal(back[name], values)
        assert back[name].dtype == values.dtype
    assert (tmp_path / "corridor_0.parquet").read_bytes() == (tmp_path / "again.parquet").read_bytes()
    write_manifest(tmp_path, INSTANTS, {"corridor_0": "c", "again": "a"})
    made_with, shards = read_manifest(tmp_path)
    assert (made_with, list(shards)) == (INSTANTS, ["corridor_0", "again"])  # in the order of their numbers
    assert count_rows_of(tmp_path) == 2 * count


@pytest.mark.parametrize("name", ["/dev/zero", "../place"])
def test_a_manifest_names_files_of_its_folder_alone(tmp_path, name):
    write_manifest(tmp_path, INSTANTS, {"place": "p"})
    path = tmp_path / "manifest.json"
    path.write_text(path.read_text().replace('"place"', json.dumps(name)))
    with unread(path):
        read_manifest(tmp_path)


def test_another_column_or_version_is_named(folder, table):
    columns = step_columns(table)
    step, near = (columns[name] for name in ("step", "angular_grid"))
    missing = {name: values for name, values in columns.items() if name != "step"}
    for wrong, where, version in (
        (missing, "column step", SCHEMA),
        (columns | {"step": step.astype(np.float32)}, "column step", SCHEMA),
        (columns | {"angular_grid": near[:, 1:]}, "column angular_grid", SCHEMA),
        (columns, "schema", SCHEMA - 1),
    ):
        write_blocks([wrong], folder / "walled.parquet", version)
        with unread(folder / "walled.parquet", where):
            read_whole(folder, "walled")


def test_a_small_file_that_decodes_to_much_more_is_refused(tmp_path):
    """A quarter of a million equal rows of a kilobyte take some kilobytes."""
    index = pa.DictionaryArray.from_arrays(
        pa.array(np.zeros(2**18, np.int8)), pa.array([bytes(1000)], pa.binary(1000))
    )
    pq.write_table(pa.table({"crop": index}), tmp_path / "a.parquet", store_schema=False)
    assert (tmp_path / "a.parquet").stat().st_size < 2**16
    with unread(tmp_path / "a.parquet"):
        read_columns(tmp_path / "a.parquet", {"crop": (1000,)})


def test_the_manifest_knows_the_scene(folder):
    about = (folder / "manifest.json").read_text()
    (folder / "scene/map.pgm").write_bytes(b"another map")
    write_manifest(folder, LSTM_ROWS, {"walled": scene_digest(folder / "scene")})
    assert (folder / "manifest.json").read_text() != about


def test_embeddings_of_other_rows_are_refused(folder, table):
    write_embeddings([np.zeros((len(table) - 1, 392), np.float16)], folder / "embeddings", "walled")
    with pytest.raises(InputError):
        load_rows({"a": folder}, {"a": folder / "embeddings"})
