"""Forecasts of the people in a data frame, in one call."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pedpred.command.forecast_tables import forecast_table
from pedpred.command.maps import map_at
from pedpred.command.prediction import robot_for
from pedpred.errors import ValueRuleError
from pedpred.online.replay import as_windows, replay_scene
from pedpred.scenes import OccupancyMap, Scene, checked_placement
from pedpred.sources.single_file import checked_interval_s
from pedpred.tables.classes import classes_of_people, label_of
from pedpred.tables.options import TableOptions
from pedpred.tables.placeholders import without_placeholders
from pedpred.tables.reading import tracks_in_rows
from pedpred.tables.text import Row
from pedpred.tables.titles import LENGTHS, columns_of_classes, titles_of_tracks

_TABLE = Path("table")
_METHOD = "pedpred"


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
            columns may be called in CSV files. Times may be dates. Ids may be anything that is not missing.
            Rows without a position (NaN, None) are missing detections, and left out; so are rows of a class
            that is not called a person, if another one is.
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
    titles = [str(title) for title in table.columns]
    named = titles_of_tracks(titles)
    table = _people_in(table, titles)
    (id_title,) = (title for title, name in named.items() if name == "track_id")
    values = {title: table.iloc[:, titles.index(title)] for title in named}
    who, names = pd.factorize(values[id_title])
    placed = np.logical_or.reduce([values[t].notna() for t, name in named.items() if name in LENGTHS])
    if (lost := (who < 0) & placed).any():
        raise ValueRuleError(id_title, None, f"row {int(lost.argmax()) + 1} has no id")
    values[id_title] = pd.Series(who, index=table.index).where(who >= 0)
    people = tracks_in_rows(_TABLE, list(named), _rows(values.values()), TableOptions(None, rate_hz, unit))
    people = without_placeholders(_TABLE, people)
    dt_s = checked_interval_s(_TABLE, people, titled=True, sure=unit is not None)
    if isinstance(occupancy, str | Path):
        occupancy = map_at(Path(occupancy))
    scene = Scene("table", people, occupancy or OccupancyMap.free_around(people.position), dt_s)
    checked_placement(scene)
    predictor = robot_for(scene, None if model is None else Path(model))
    windows = as_windows(scene, replay_scene(scene, predictor), _METHOD, predictor.protocol)
    forecasts = forecast_table(windows, _METHOD)
    return forecasts.assign(track=names.take(forecasts["track"].to_numpy()))


def _check_kind(field: str, value: object, kind: Any, called: str) -> None:
    if not isinstance(value, kind):
        raise ValueRuleError(field, value, f"it must be {called}")


def _people_in(table: pd.DataFrame, titles: Sequence[str]) -> pd.DataFrame:
    """The rows that are about people; see `classes_of_people`."""
    labels = {
        title: table.iloc[:, titles.index(title)].map(lambda one: "" if pd.isna(one) else label_of(str(one)))
        for title in columns_of_classes(titles)
    }
    counts = {title: Counter(values) for title, values in labels.items()}
    chosen = classes_of_people(_TABLE, counts) if counts else None
    return table if chosen is None else table[labels[chosen[0]].isin(chosen[1])]


def _rows(columns: Iterable[pd.Series]) -> Iterator[Row]:
    """The rows as text, which is exact for numbers, counted from 1; missing values are empty."""
    written = (
        ["" if missing else str(value) for value, missing in zip(column.tolist(), column.isna(), strict=True)]
        for column in columns
    )
    yield from enumerate(zip(*written, strict=True), start=1)
