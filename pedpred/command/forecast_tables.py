"""Forecasts as tables: a row per person, time, mode and step, as CSV, Parquet or a data frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.files import atomic_write
from pedpred.reading.errors import ContentError
from pedpred.reading.names import TrackNames
from pedpred.storage.columns import count_rows
from pedpred.storage.tracks import MOST_NUMBERS

COLUMNS = ("track", "time", "mode", "weight", "step", "x", "y")
"""A row per step of each mode: of which track, made when (s), and where the person will be (world, m)."""
PARQUET = ".parquet"
SUFFIXES = (".csv", PARQUET)
_MOST_ROWS = MOST_NUMBERS // len(COLUMNS)


def forecast_table(windows: EvaluationWindows, method: str, names: TrackNames | None = None) -> pd.DataFrame:
    """The forecasts of a method with the columns `COLUMNS`; steps count from 1.

    Args:
        windows: with the forecasts.
        method: name of the method.
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
        if path.suffix == PARQUET:
            table.to_parquet(new, index=False, compression="zstd")
        else:
            table.to_csv(new, index=False, float_format="%.4f")


def read_forecast_table(path: Path) -> pd.DataFrame:
    """Read the columns `COLUMNS` of a CSV or Parquet file; tracks are text or numbers, others finite numbers.

    Raises:
        ContentError: a column is missing or holds something else; the message names the row, from 1.
    """
    if path.suffix == PARQUET:
        rows = count_rows(path)
        table = pd.read_parquet(path) if rows <= _MOST_ROWS else pd.DataFrame()
    else:
        table = pd.read_csv(path, dtype={"track": str}, keep_default_na=False, nrows=_MOST_ROWS + 1)
        rows = len(table)
    if rows > _MOST_ROWS:
        raise ContentError(f"more than {_MOST_ROWS} rows", "Divide the file")
    if missing := [name for name in COLUMNS if name not in table]:
        problem = f"no column {missing[0]}; there are {', '.join(map(str, table.columns))[:200]}"
        raise ContentError(problem, f"The header is {','.join(COLUMNS)}")
    _check(table["track"], table["track"].notna() & (table["track"] != ""), "an id")
    numbers = table[[*COLUMNS[1:]]].apply(pd.to_numeric, errors="coerce").astype(float)
    for name in numbers:
        _check(table[name], np.isfinite(numbers[name]), "a finite number")
    for name in ("mode", "step"):
        _check(table[name], numbers[name] % 1 == 0, "a whole number")
    return numbers.assign(track=table["track"])


def _check(column: pd.Series, right: pd.Series, expected: str) -> None:
    if not right.all():
        row = int(np.flatnonzero(~right)[0])
        raise ContentError(f"row {row + 1}: {column.name} = {column.iloc[row]!r} is not {expected}")
