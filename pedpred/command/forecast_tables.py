"""Forecasts as tables: a row per person, time, mode and step, as CSV, Parquet or a data frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.files import atomic_write, check_input
from pedpred.reading.errors import ContentError, add_path
from pedpred.reading.head import Head
from pedpred.reading.names import TrackNames
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import column_titles, is_columnar, read_columnar, text_form
from pedpred.reading.text import numbers, read_columns
from pedpred.reading.tracks import is_missing, number_ids

COLUMNS = ("track", "time", "mode", "weight", "step", "x", "y")
"""A row per step of each mode: whose forecast, made when (s), and where the person will be (world, m)."""

SUFFIXES = (".csv", ".parquet")


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


def read_forecast_table(path: Path) -> tuple[dict[str, np.ndarray], TrackNames]:
    """Read the columns of such a file, with `track_id` for track, and `line`, and what tracks are called.

    Raises:
        InputError: a column is missing or holds something else than finite numbers.
    """
    check_input(path)
    with add_path(path):
        columnar = is_columnar(Head.of(path).raw)
        form = None if columnar else text_form(path, ReadOptions())[0]
        titles = column_titles(path) if form is None else form.titles
        if missing := [name for name in COLUMNS if name not in titles]:
            problem = f"no column {missing[0]}; there are {', '.join(titles)[:200]}"
            raise ContentError(problem, f"The header is {','.join(COLUMNS)}")
        wanted = {name: name for name in COLUMNS}
        table = read_columnar(path, wanted) if form is None else read_columns(path, form, wanted, ("track",))
        before = None if form is None else form.skipped
        line = np.arange(table.num_rows) + 1 + (before or 0)
        for name in COLUMNS:
            if (lost := is_missing(table[name])).any():
                raise ContentError(f"{name} is missing", line=int(line[lost][0]))
        columns = {name: numbers(table[name], name, before) for name in COLUMNS[1:]}
        for name in ("mode", "step"):
            if len(wrong := np.flatnonzero(columns[name] % 1)):
                problem = f"{name} = {columns[name][wrong[0]]:g}, but it must be a whole number"
                raise ContentError(problem, line=int(line[wrong[0]]))
        track_id, names = number_ids(table["track"], np.zeros(table.num_rows, bool))
    return {"line": line, "track_id": track_id, **columns}, names
