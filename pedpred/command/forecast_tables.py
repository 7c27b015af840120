"""Forecasts as tables: a row per person, time, mode and step, as CSV, Parquet or a data frame."""

from __future__ import annotations

import csv
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from pedpred.errors import SourceError
from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.files import atomic_write, translate_errors
from pedpred.storage.columns import column_names, count_rows, read_columns
from pedpred.storage.tracks import MOST_NUMBERS
from pedpred.tables.text import read_numbers, text_lines

COLUMNS = ("track", "time", "mode", "weight", "step", "x", "y")
"""A row per step of each mode: whose forecast, made when (s), and where the person will be (world, m)."""

SUFFIXES = (".csv", ".parquet")
_WHOLE = ("track", "mode", "step")


def forecast_table(windows: EvaluationWindows, method: str) -> pd.DataFrame:
    """The forecasts of a method with the columns `COLUMNS`; steps count from 1."""
    own = windows.predictions[method]
    row, mode, step = (axis.ravel() for axis in np.indices(own.path.shape[:3]))
    columns = {
        "track": windows.track_id[row],
        "time": windows.time_s[row],
        "mode": mode,
        "weight": own.weight[row, mode],
        "step": step + 1,
        "x": own.path[row, mode, step, 0],
        "y": own.path[row, mode, step, 1],
    }
    return pd.DataFrame(columns)


def write_forecasts(windows: EvaluationWindows, method: str, path: Path) -> None:
    """Write `forecast_table` as CSV (to 0.1 mm) or, where the name ends in .parquet, as Parquet (exactly)."""
    table = forecast_table(windows, method)
    with atomic_write(path) as new:
        if path.suffix == ".parquet":
            table.to_parquet(new, index=False, compression="zstd")
        else:
            table.to_csv(new, index=False, float_format="%.4f")


def read_forecast_table(path: Path) -> dict[str, np.ndarray]:
    """Read the columns of such a file, with `track_id` for track, and `line`.

    Raises:
        SourceError: a column is missing or holds something else than finite numbers.
        StorageError: the Parquet file is damaged.
    """
    if path.suffix == ".parquet":
        return _read_parquet(path)
    lines = text_lines(path)
    _, header = next(lines, (1, ""))
    titles = [title.strip() for title in next(csv.reader([header]), [])]
    _check_columns(path, titles)
    rows = ((line, next(csv.reader([text]))) for line, text in lines)
    return read_numbers(path, rows, titles, {name: name for name in COLUMNS} | {"track": "track_id"})


def _read_parquet(path: Path) -> dict[str, np.ndarray]:
    _check_columns(path, column_names(path))
    if (rows := count_rows(path)) * len(COLUMNS) > MOST_NUMBERS:
        raise SourceError(
            path, None, f"{rows} rows, at most {MOST_NUMBERS // len(COLUMNS)}", "Divide the file"
        )
    with translate_errors(partial(SourceError, path, None)):
        columns = read_columns(path, dict.fromkeys(COLUMNS, ()))
        for name, values in columns.items():
            whole = name in _WHOLE
            if values.dtype.kind not in ("iu" if whole else "iuf") or not np.isfinite(values).all():
                what = "whole" if whole else "finite"
                raise SourceError(path, None, f"column {name} holds other values than {what} numbers")
        columns = {
            name: values.astype(np.int64 if name == "track" else np.float64)
            for name, values in columns.items()
        }
    return {"line": np.arange(1, rows + 1), "track_id": columns.pop("track"), **columns}


def _check_columns(path: Path, titles: list[str]) -> None:
    if missing := [name for name in COLUMNS if name not in titles]:
        problem = f"no column {missing[0]}; found were {', '.join(titles)[:200]}"
        raise SourceError(path, 1, problem, f"The header is {','.join(COLUMNS)}")
