"""Forecasts of the people in a data frame, in one call."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pedpred.command.forecast_tables import forecast_table
from pedpred.command.maps import map_at
from pedpred.command.prediction import robot_for
from pedpred.errors import ValueRuleError, in_words_of_python
from pedpred.online.replay import as_windows, replay_scene
from pedpred.scenes import OccupancyMap, Scene, Trajectories, checked_placement
from pedpred.sources.single_file import checked_interval_s
from pedpred.tables.dates import column_of_days
from pedpred.tables.ids import is_plain
from pedpred.tables.names import TrackNames
from pedpred.tables.options import TableOptions
from pedpred.tables.placeholders import without_placeholders
from pedpred.tables.reading import LOOKED_AT, columns_of_labels, of_people, people_in_rows, tracks_in_rows
from pedpred.tables.text import Row
from pedpred.tables.titles import (
    LENGTHS,
    columns_of_classes,
    columns_of_flags,
    columns_of_heights,
    columns_of_recordings,
    joined_titles,
    other_pairs,
    sides_of_boxes,
    titles_of_tracks,
)

_TABLE = Path("table")
_METHOD = "pedpred"


@in_words_of_python()
def predict(
    table: pd.DataFrame,
    occupancy: OccupancyMap | str | Path | None = None,
    *,
    rate_hz: float | None = None,
    unit: str | None = None,
    model: str | Path | None = None,
) -> pd.DataFrame:
    """Forecast all people after each of their detections, with causal tracking as on a robot.

    Args:
        table: detections with the columns time (s) or frame, id, x, y (m); or what such
            columns may be called in CSV files. Levels of the index with such names count where the columns
            alone do not say it, and levels of titles are joined. Times may be dates. Ids may be anything
            that is not missing. Rows without a position (NaN, None) are missing detections, and left out; so
            are rows of a class that is not called a person, if another one is.
        occupancy: static obstacles in the same frame, or the path of a map; None: free ground.
        rate_hz: frames per second, where there are frames.
        unit: of lengths: "m", "cm", "mm", "ft" or "inch".
        model: a model folder; None: the default one.

    Returns:
        A row per person, time, mode and step: track (the id), time (of the detection, s), mode, weight, step
        (from 1, 0.3 s apart for the default model), x, y (m, world frame).

    Raises:
        ValueRuleError: a column is missing, or an id; or an argument is something else.
        SourceError: a value is not a number, titles are exchanged, positions are degrees, or people
            would move at impossible speeds; the line is the row.
    """
    _check_kind("table", table, pd.DataFrame, "a DataFrame of pandas")
    _check_kind("occupancy", occupancy, OccupancyMap | str | Path | None, "an OccupancyMap, a path or None")
    _check_kind("rate_hz", rate_hz, Real | None, "a number or None")
    _check_kind("model", model, str | PathLike | None, "a path or None")
    people, dt_s, ids = _people_in(table, rate_hz, unit)
    if isinstance(occupancy, str | Path):
        occupancy = map_at(Path(occupancy))
    scene = Scene("table", people, occupancy or OccupancyMap.free_around(people.position), dt_s)
    checked_placement(scene)
    predictor = robot_for(scene, None if model is None else Path(model))
    windows = as_windows(scene, replay_scene(scene, predictor), _METHOD, predictor.protocol)
    forecasts = forecast_table(windows, _METHOD)
    return forecasts.assign(track=ids.loc[forecasts["track"]].array)


def _people_in(
    table: pd.DataFrame, rate_hz: float | None, unit: str | None
) -> tuple[Trajectories, float, pd.Series]:
    """Read the people, the usual time between two detections, s, and the ids by track number.

    See `predict`.
    """
    table = _with_index(table)
    titles = _titles_of(table)
    named = titles_of_tracks(titles)
    begin = table.iloc[:LOOKED_AT]
    labels = columns_of_labels(titles, list(_rows(column for _, column in begin.items())))
    doubtful = {
        title for find in (other_pairs, sides_of_boxes) for pair in find(titles, named) for title in pair
    }
    others = {*named, *_others(titles), *labels, *doubtful}
    looked_at = [title for title in dict.fromkeys(titles) if title in others]
    values = {title: table.iloc[:, titles.index(title)] for title in looked_at}
    (id_title,) = (title for title, name in named.items() if name == "track_id")
    who, ids = pd.factorize(values[id_title])
    numbers, names = _numbered(ids)
    options = TableOptions(None, rate_hz, unit, names=names)
    first = list(islice(_rows(values.values()), LOOKED_AT))
    chosen = people_in_rows(_TABLE, looked_at, lambda: _rows(values.values()), options, first)
    counts = np.zeros(len(table), bool)
    counts[[row - 1 for row, _ in of_people(_rows(values.values()), looked_at, chosen)]] = True
    placed = np.logical_or.reduce([values[t].notna() for t, name in named.items() if name in LENGTHS])
    if (lost := (who < 0) & placed & counts).any():
        raise ValueRuleError(id_title, None, f"row {int(lost.argmax()) + 1} has no id")
    values[id_title] = pd.Series(pd.array(np.append(numbers, 0).take(who), "Int64")).where(who >= 0)
    rows = ((row, fields) for row, fields in _rows(values.values()) if counts[row - 1])
    people = tracks_in_rows(_TABLE, looked_at, rows, options)
    people = without_placeholders(_TABLE, people)
    dt_s = checked_interval_s(_TABLE, people, titled=True, options=options)
    return people, dt_s, pd.Series(ids, index=numbers)


def _with_index(table: pd.DataFrame) -> pd.DataFrame:
    """The table; where its columns do not hold tracks, with those levels of its index that have names."""
    levels = [at for at, name in enumerate(table.index.names) if name is not None and name not in table]
    try:
        titles_of_tracks(_titles_of(table))
    except ValueRuleError:
        return table.reset_index(level=levels) if levels else table
    return table


def _titles_of(table: pd.DataFrame) -> list[str]:
    """The title of each column; those of several levels are joined, as in files that pandas writes."""
    levels = range(table.columns.nlevels)
    return joined_titles([list(map(str, table.columns.get_level_values(level))) for level in levels])


def _check_kind(field: str, value: object, kind: Any, called: str) -> None:
    if not isinstance(value, kind):
        raise ValueRuleError(field, value, f"it must be {called}")


def _numbered(ids: pd.Index) -> tuple[np.ndarray, TrackNames]:
    """Numbers of ids, and their names where the numbers are not the ids themselves. [T] int64."""
    written = [
        str(int(name) if isinstance(name, float) and name.is_integer() else name).strip()
        for name in ids.tolist()
    ]
    if all(map(is_plain, written)) and len(set(written)) == len(written):
        return np.array(list(map(int, written)), np.int64), TrackNames()
    return np.arange(len(written)), TrackNames(dict(enumerate(written)))


def _others(titles: Sequence[str]) -> list[str]:
    """Titles of columns that say more about a table: classes, days, heights, and what is apart."""
    at = [*columns_of_heights(titles), *([] if (day := column_of_days(titles)) is None else [day])]
    flags = columns_of_flags(titles)
    return [
        *columns_of_classes(titles),
        *columns_of_recordings(titles),
        *flags,
        *(titles[each] for each in at),
    ]


def _rows(columns: Iterable[pd.Series]) -> Iterator[Row]:
    """The rows as text, which is exact for numbers, counted from 1; missing values are empty."""
    written = (
        ["" if missing else str(value) for value, missing in zip(column.tolist(), column.isna(), strict=True)]
        for column in columns
    )
    yield from enumerate(zip(*written, strict=True), start=1)
