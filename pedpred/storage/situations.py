"""Situations on disk, the training rows of networks without memory: one Parquet file per world or viewing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from pedpred.errors import StorageError
from pedpred.features.situation import channel_widths
from pedpred.features.table import FeatureSettings
from pedpred.files import translate_errors
from pedpred.storage.columns import read_columns, write_blocks
from pedpred.storage.manifests import StoredColumn, check_types, read_manifest_of, shapes_of, write_about

SITUATION_SCHEMA = 1
_REMEDY = "Write it again"
_HALF = ("neighbours", "beams")  # to about 4 mm at 8 m
_ABOUT = {
    "state": "tracked velocity (forward, left), m/s",
    "history": "(forward, left), m, and 1 where known; 0, dt_s, 2 dt_s, ... before the present, row-major",
    "track": "last velocity (forward, left), m/s; P_pp, P_pv, P_vv of the tracker; age",
    "neighbours": "(forward, left), m, their velocity, m/s, and weight; nearest first, row-major",
    "beams": "m, distance to the nearest obstacle, counter-clockwise from the heading",
}


def situation_columns(sizes: FeatureSettings) -> dict[str, StoredColumn]:
    """Every column: the channels of `features.situation` and the targets. Agent frame."""
    channels = {
        name: StoredColumn("float16" if name in _HALF else "float32", (width,), _ABOUT[name])
        for name, width in channel_widths(sizes).items()
    }
    return channels | {
        "future": StoredColumn("float32", (sizes.horizon_steps, 2), "m/s (forward, left), row-major")
    }


def write_situations(columns: Mapping[str, np.ndarray], folder: Path, name: str) -> None:
    """Write the rows of one world or viewing as `<folder>/<name>.parquet`.

    Args:
        columns: channel -> [M, width], and `future`, [M, P, 2]; see `situation_columns`.
        folder: of the set.
        name: of the world or viewing.
    """
    halved = {key: value.astype(np.float16 if key in _HALF else np.float32) for key, value in columns.items()}
    full = [key for key in halved if key not in _HALF]
    write_blocks([halved], folder / f"{name}.parquet", SITUATION_SCHEMA, split=full)


def write_situations_manifest(folder: Path, sizes: FeatureSettings, names: Sequence[str]) -> None:
    """Write `manifest.json`: schema version, sizes, columns with units, names of the files.

    Args:
        folder: of the set.
        sizes: that the rows were made with.
        names: of the worlds or viewings; none where a recording is not available.
    """
    write_about(folder, SITUATION_SCHEMA, sizes, situation_columns(sizes), {"names": list(names)})


def read_situations_manifest(folder: Path) -> tuple[FeatureSettings, list[str]]:
    """Sizes of a set, and the names of its files.

    Raises:
        StorageError: the manifest is missing, damaged or of another schema version.
    """
    sizes, names = read_manifest_of(folder, SITUATION_SCHEMA, "names")
    with translate_errors(partial(StorageError, folder / "manifest.json", "names", remedy=_REMEDY)):
        return sizes, [str(name) for name in names]


def read_situations(folder: Path, name: str, sizes: FeatureSettings) -> dict[str, np.ndarray]:
    """Read the rows of one world or viewing; `neighbours` and `beams` are float16, all others float32.

    Returns:
        Channel -> [M, width], and `future`, [M, P, 2].

    Raises:
        StorageError: the file is damaged or of another schema version, or a column is missing or of
            another type or size; it names file and field.
    """
    path, wanted = folder / f"{name}.parquet", situation_columns(sizes)
    columns = read_columns(path, shapes_of(wanted), SITUATION_SCHEMA)
    check_types(path, columns, wanted)
    return columns
