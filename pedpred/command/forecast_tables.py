"""Forecasts as tables: a row per person, time, mode and step, as CSV, Parquet or a data frame."""

from __future__ import annotations

import csv
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from pedpred.errors import SourceError
from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.files import atomic_write, translate_errors
from pedpred.storage.columns import column_names, count_rows, read_columns
from pedpred.storage.tracks import MOST_NUMBERS
from pedpred.tables.ids import Ids
from pedpred.tables.lines import of_width
from pedpred.tables.names import TrackNames
from pedpred.tables.quotes import joined
from pedpred.tables.text import read_numbers, text_lines

COLUMNS = ("track", "time", "mode", "weight", "step", "x", "y")
"""A row per step of each mode: whose forecast, made when (s), and where the person will be (world, m)."""

SUFFIXES = (".csv", ".parquet")
_WHOLE = ("track", "mode", "step")
_LARGEST_WORDS_BYTES = 2**26
_EXACT = 2.0**53  # floats of larger whole numbers are rounded


def forecast_table(windows: EvaluationWindows, method: str, names: TrackNames | None = None) -> pd.DataFrame:
    """The forecasts of a method with the columns `COLUMNS`; steps count from 1.

    Args:
        windows: with the forecasts.
        method: whose.
        names: of tracks, in place of their numbers.
    """
    predictions = windows.predictions[method]
    row, mode, step = (axis.ravel() for axis in np.indices(predictions.path.shape[:3]))
    columns = {
        "track": (names or TrackNames()).column(windows.track_id)[row],
        "time": windows.time_s[row],
        "mode": mode,
        "weight": predictions.weight[row, mode],
        "step": step + 1,
        "x": predictions.path[row, mode, step, 0],
        "y": predictions.path[row, mode, step, 1],
    }
    return pd.DataFrame(columns)


def write_forecasts(
    windows: EvaluationWindows, method: str, path: Path, names: TrackNames | None = None
) -> None:
    """Write `forecast_table` as CSV (to 0.1 mm) or, where the name ends in .parquet, as Parquet (exactly)."""
    table = forecast_table(windows, method, names)
    with atomic_write(path) as new:
        if path.suffix == ".parquet":
            table.to_parquet(new, index=False, compression="zstd")
        else:
            table.to_csv(new, index=False, float_format="%.4f")


def read_forecast_table(path: Path, names: TrackNames) -> dict[str, np.ndarray]:
    """Read the columns of such a file, with `track_id` for track, and `line`.

    Args:
        path: the file.
        names: takes those of tracks, where some are words; `track_id` then counts them.

    Raises:
        SourceError: a column is missing or holds something else than finite numbers.
        StorageError: the Parquet file is damaged.
    """
    if path.suffix == ".parquet":
        return _read_parquet(path, names)
    lines = joined(text_lines(path))
    _, header = next(lines, (1, ""))
    titles = [title.strip() for title in next(csv.reader([header]), [])]
    _check_columns(path, titles)
    rows = of_width(path, ((line, next(csv.reader([text]))) for line, text in lines), titles)
    ids, wanted = Ids(path, "track"), {name: name for name in COLUMNS} | {"track": "track_id"}
    columns = read_numbers(path, ids.numbered(rows, titles.index("track")), titles, wanted)
    columns["track_id"], words = ids.of_tracks(columns["track_id"])
    names.add(words)
    return columns


def _read_parquet(path: Path, names: TrackNames) -> dict[str, np.ndarray]:
    _check_columns(path, column_names(path))
    if (rows := count_rows(path)) * len(COLUMNS) > MOST_NUMBERS:
        raise SourceError(
            path, None, f"{rows} rows, at most {MOST_NUMBERS // len(COLUMNS)}", "Divide the file"
        )
    with translate_errors(partial(SourceError, path, None)):
        words = _read_words(path, "track")
        columns = read_columns(path, {name: () for name in COLUMNS if words is None or name != "track"})
        if words is not None:
            names.add(words.dictionary.to_pylist())
            columns["track"] = words.indices.to_numpy()
        for name, values in columns.items():
            what = "whole" if name in _WHOLE else "finite"
            if values.dtype.kind not in "iuf" or not _are(what, values):
                raise SourceError(path, None, f"column {name} holds other values than {what} numbers")
        columns = {
            name: values.astype(np.int64 if name == "track" else np.float64)
            for name, values in columns.items()
        }
    return {"line": np.arange(1, rows + 1), "track_id": columns.pop("track"), **columns}


def _are(what: str, values: np.ndarray) -> bool:
    """Whether all numbers are finite, or whole ones that a float holds exactly, as data frames keep them."""
    if what == "finite" or values.dtype.kind != "f":
        return bool(np.isfinite(values).all())
    return bool(((values == np.rint(values)) & (np.abs(values) < _EXACT)).all())


def _read_words(path: Path, name: str) -> pa.DictionaryArray | None:
    """The words in a column; None: it holds no text.

    Raises:
        SourceError: words are missing or too long.
    """
    with pq.ParquetFile(path, read_dictionary=[name], page_checksum_verification=True) as file:
        kind, at = file.schema_arrow.field(name).type, file.schema_arrow.names.index(name)
        kind = kind.value_type if pa.types.is_dictionary(kind) else kind
        if not (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
            return None
        groups = (file.metadata.row_group(group) for group in range(file.num_row_groups))
        size = sum(group.column(at).total_uncompressed_size for group in groups)
        if size > _LARGEST_WORDS_BYTES:
            problem = f"the words of column {name} take {size} bytes, at most {_LARGEST_WORDS_BYTES}"
            raise SourceError(path, None, problem, "Divide the file")
        words = file.read([name])[name].unify_dictionaries().combine_chunks()
    if words.null_count:
        raise SourceError(path, None, f"column {name} has {words.null_count} missing values")
    return words if isinstance(words, pa.DictionaryArray) else words.dictionary_encode()


def _check_columns(path: Path, titles: list[str]) -> None:
    if missing := [name for name in COLUMNS if name not in titles]:
        problem = f"no column {missing[0]}; there are {', '.join(titles)[:200]}"
        raise SourceError(path, 1, problem, f"The header is {','.join(COLUMNS)}")
