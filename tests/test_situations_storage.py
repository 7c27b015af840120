"""Situations survive the disk; damaged files name what is wrong."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pedpred.errors import InputError
from pedpred.features import ForecastProtocol
from pedpred.models.features import RowFormat
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.storage.situations import (
    read_situations,
    read_situations_manifest,
    situation_columns,
    write_situations,
    write_situations_manifest,
)

FEATURES = MixtureFeatures(beams=8, neighbours=2, history_steps=3)
SIZES = RowFormat(ForecastProtocol(horizon_steps=4), "mixture", FEATURES)
COLUMNS = situation_columns(SIZES)


def rows(count, seed=0):
    rng = np.random.default_rng(seed)
    return {
        name: rng.normal(0, 5, (count, *about.shape)).astype(about.dtype) for name, about in COLUMNS.items()
    }


@pytest.mark.parametrize("count", [0, 1, 30])
def test_rows_survive_the_disk_exactly(tmp_path, count):
    write_situations(rows(count), tmp_path, "corridor_0", COLUMNS)
    back = read_situations(tmp_path, "corridor_0", SIZES)
    assert list(back) == list(COLUMNS)
    for name, values in rows(count).items():
        np.testing.assert_array_equal(back[name], values)
        assert back[name].dtype == values.dtype


def test_the_same_rows_give_the_same_bytes(tmp_path):
    for name in "ab":
        write_situations(rows(9), tmp_path, name, COLUMNS)
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


@pytest.mark.parametrize("names", [[], ["square_1", "square_0"]])
def test_a_manifest_survives_the_disk(tmp_path, names):
    write_situations_manifest(tmp_path, SIZES, names)
    assert read_situations_manifest(tmp_path) == (SIZES, names)


def test_errors_name_file_and_field(tmp_path):
    wider = replace(SIZES, features=replace(FEATURES, beams=12))
    write_situations(rows(3), tmp_path, "room_0", COLUMNS)
    for name, made_with, where in (("room_0", wider, "column beams"), ("room_1", SIZES, "file")):
        with pytest.raises(InputError) as refused:
            read_situations(tmp_path, name, made_with)
        assert (refused.value.path, refused.value.where) == (tmp_path / f"{name}.parquet", where)
    write_situations_manifest(tmp_path, SIZES, ["room_0"])
    about = json.loads((tmp_path / "manifest.json").read_text())
    (tmp_path / "manifest.json").write_text(json.dumps(about | {"schema": 0}))
    with pytest.raises(InputError) as refused:
        read_situations_manifest(tmp_path)
    assert refused.value.where == "schema"


@pytest.mark.parametrize("name", ["/dev/zero", "../place", None])
def test_a_manifest_names_files_of_its_folder_alone(tmp_path, name):
    write_situations_manifest(tmp_path, SIZES, ["place"])
    path = tmp_path / "manifest.json"
    path.write_text(path.read_text().replace('"place"', json.dumps(name)))
    with pytest.raises(InputError) as refused:
        read_situations_manifest(tmp_path)
    assert refused.value.path == path
