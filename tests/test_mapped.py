"""Data sets larger than memory: rows on disk are the rows that were added, and leave no file."""

import itertools
import os
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.datasets.rows import load_rows
from pedpred.errors import NO_ROOM
from pedpred.features import extract_blocks
from pedpred.rows.files import (
    read_shard,
    scene_digest,
    step_columns,
    write_embeddings,
    write_manifest,
    write_shard,
)
from pedpred.storage.mapped import MappedRows
from pedpred.storage.scenes import write_scene
from tests.disk import small_files
from tests.exported import LSTM_ROWS
from tests.worlds import tracked, walled_scene

ROOT = Path(__file__).parents[1]
# every shard and the scene that it shows
SHARDS = {"a": "a", "a_mirrored": "a", "b": "b", "b_mirrored": "b", "c": "c", "c_mirrored": "c"}
ON_DISK = """
import pathlib, re, resource, sys
import numpy as np
from pedpred.storage.mapped import MappedRows
rows, blocks = MappedRows("rows"), int(sys.argv[1])
for block in range(blocks):
    rows.append(np.full((2**16, 64), block, np.float32))
assert rows.array().max() == blocks - 1
held = re.findall(r"(?:RssAnon|VmSwap):\\s+(\\d+) kB", pathlib.Path("/proc/self/status").read_text())
print(sum(map(int, held)) / 1024, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """Three scenes with a variant each, in shards of several blocks; a row's codes are its crop's bits."""
    folder = tmp_path_factory.mktemp("stored")
    for index, (name, scene_name) in enumerate(SHARDS.items()):
        scene = walled_scene(np.random.default_rng(index))
        blocks = list(extract_blocks(scene, tracked(scene), LSTM_ROWS.protocol, LSTM_ROWS.features, rows=100))
        assert len(blocks) > 1
        write_shard(map(step_columns, blocks), folder, name, LSTM_ROWS)
        write_embeddings(
            (code_of(block.inputs["occupancy"]) for block in blocks), folder / "embeddings", name
        )
        write_scene(scene, folder / "scenes" / scene_name)
    write_manifest(
        folder,
        LSTM_ROWS,
        {name: scene_digest(folder / "scenes" / scene) for name, scene in SHARDS.items()},
    )
    return folder


def code_of(packed):
    return np.bitwise_count(packed[:, :9]).astype(np.float16)


@given(
    st.lists(st.integers(0, 5), min_size=1, max_size=6),
    st.sampled_from([(), (3,), (2, 2), (0,)]),
    st.sampled_from([np.float16, np.float32, np.int64, np.uint8, bool]),
)
def test_mapped_rows_are_the_rows_that_were_added(lengths, shape, dtype):
    rng = np.random.default_rng(sum(lengths))
    blocks = [rng.integers(0, 2, (length, *shape)).astype(dtype) for length in lengths]
    rows = MappedRows("rows")
    rows.extend(blocks)
    array = rows.array()
    assert len(rows) == sum(lengths)
    assert array.dtype == dtype
    del rows  # the array outlives what made it
    np.testing.assert_array_equal(array, np.concatenate(blocks))
    assert not any(Path("build").iterdir())  # not even while they are in use


def test_a_full_disk_is_an_error_when_rows_are_added():
    rows = MappedRows("rows")
    with small_files(4096), pytest.raises(OSError) as full:  # noqa: PT011, checked below
        rows.append(np.zeros(1000))
    assert full.value.errno in NO_ROOM


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs Linux")
def test_rows_on_disk_are_no_memory_of_the_process(tmp_path):
    """Twenty blocks of sixteen megabytes: what holds one block and numpy would not hold them all."""
    command = [sys.executable, "-c", ON_DISK, "20"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    private_mib, peak_mib = map(float, done.stdout.split())
    assert 16 < private_mib < 240
    assert peak_mib > 320  # where mapped pages count, all are seen


def test_a_data_set_is_its_shards_in_a_row(stored):
    data = load_rows({"a": stored}, {"a": stored / "embeddings"})
    blocks = [block for name in SHARDS for block in read_shard(stored, name, LSTM_ROWS)]
    whole = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    channels = LSTM_ROWS.features.channels(whole)
    for name, values in (channels | {"grid": code_of(whole["occupancy"])}).items():
        np.testing.assert_array_equal(data.channels[name].numpy(), values)
    np.testing.assert_array_equal(data.future.numpy(), whole["future"])
    np.testing.assert_array_equal(data.future_steps.numpy(), whole["future_steps"])
    starts = np.flatnonzero(whole["step"] == 0)
    np.testing.assert_array_equal(data.spans.rows[:, 0], starts)
    np.testing.assert_array_equal(data.spans.rows[:, 1], [*starts[1:], len(data.future)])
    np.testing.assert_array_equal(data.spans.track, whole["track_id"][starts])
    assert set(data.spans.scene) == {0, 1, 2}  # variants are of their scene


def test_loading_takes_as_much_memory_for_more_shards(stored, tmp_path):
    def peak(copies):
        scenes = {f"copy{i}": "a" for i in range(copies)}
        folder = tmp_path / str(copies)
        for part, name in itertools.product((folder, folder / "embeddings"), scenes):
            part.mkdir(parents=True, exist_ok=True)
            source = stored / part.relative_to(folder) / "a.parquet"
            (part / f"{name}.parquet").symlink_to(source)
        write_manifest(folder, LSTM_ROWS, scenes)
        tracemalloc.start()
        data = load_rows({"a": folder}, {"a": folder / "embeddings"})
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found, sum(t.nbytes for t in (data.channels["angular"], data.future, data.channels["grid"]))

    (little, _), (much, rows_take) = peak(2), peak(20)
    assert much < little + 0.2 * rows_take
