"""Forecasts of the people in a data frame, in one call."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd

from pedpred.command.forecast_tables import forecast_table
from pedpred.command.maps import map_at
from pedpred.command.prediction import robot_for
from pedpred.errors import ValueRuleError
from pedpred.online.replay import as_windows, replay_scene
from pedpred.scenes import OccupancyMap, Scene, checked_placement
from pedpred.sources.plausibility import check_speeds
from pedpred.sources.single_file import check_clock
from pedpred.tables.options import TableOptions
from pedpred.tables.reading import tracks_in_rows
from pedpred.tables.text import Row
from pedpred.tables.titles import titles_of_tracks

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
    """Forecast everybody after each of their detections, as a robot that sees them would.

    Args:
        table: detections with the columns time (s) or frame, id, x, y (m); or what such
            columns may be called in CSV files. Ids may be anything that is not missing.
        occupancy: static obstacles in the same frame, or the path of a map; None: free ground.
        rate_hz: frames per second, where there are frames.
        unit: of lengths: "m", "cm", "mm", "ft" or "inch".
        model: a model folder; None: the default one.

    Returns:
        A row per person, time, mode and step: track (the id), time (of the detection, s), mode, weight, step
        (from 1, 0.3 s apart for the default model), x, y (m, world frame).

    Raises:
        ValueRuleError: a column is missing, or an id.
        SourceError: a value is no number, or people would move at impossible speeds; the line is the row.
    """
    titles = [str(title) for title in table.columns]
    named = titles_of_tracks(titles)
    (id_title,) = (title for title, name in named.items() if name == "track_id")
    who, names = pd.factorize(table.iloc[:, titles.index(id_title)])
    if (who < 0).any():
        raise ValueRuleError(id_title, None, f"row {int((who < 0).argmax()) + 1} has no id")
    columns = [
        who.tolist() if title == id_title else table.iloc[:, titles.index(title)].tolist() for title in named
    ]
    people = tracks_in_rows(_TABLE, list(named), _rows(columns), TableOptions(None, rate_hz, unit))
    dt_s = people.usual_interval_s()
    check_clock(_TABLE, dt_s)
    check_speeds(_TABLE, people, sure=unit is not None)
    if isinstance(occupancy, str | Path):
        occupancy = map_at(Path(occupancy))
    scene = Scene("table", people, occupancy or OccupancyMap.free_around(people.position), dt_s)
    checked_placement(scene)
    predictor = robot_for(scene, None if model is None else Path(model))
    windows = as_windows(scene, replay_scene(scene, predictor), _METHOD, predictor.protocol)
    forecasts = forecast_table(windows, _METHOD)
    return forecasts.assign(track=names.take(forecasts["track"].to_numpy()))


def _rows(columns: Sequence[Sequence[object]]) -> Iterator[Row]:
    """The rows as text, which is exact for numbers, counted from 1."""
    for row, values in enumerate(zip(*columns, strict=True), start=1):
        yield row, [str(value) for value in values]
