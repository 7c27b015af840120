"""Forecasts of the people in a data frame, in one call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from pedpred.command.forecast_tables import forecast_table
from pedpred.command.prediction import METHOD, predictor_for
from pedpred.command.recordings import read_ground_at
from pedpred.errors import ValueRuleError
from pedpred.online.replay import as_windows, replay_scene
from pedpred.reading.checks import check
from pedpred.reading.errors import add_path
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import from_frame
from pedpred.reading.tracks import agreed_unit, to_tracks
from pedpred.scenes import OccupancyMap, Scene, checked_placement

_TABLE = Path("table")


def predict(
    table: pd.DataFrame,
    occupancy: OccupancyMap | str | Path | None = None,
    *,
    rate_hz: float | None = None,
    unit: str | None = None,
    columns: Mapping[str, str] | None = None,
    classes: Sequence[str] = (),
    any_speed: bool = False,
    model: str | Path | None = None,
) -> pd.DataFrame:
    """Forecast all people after each of their detections, with causal tracking as on a robot.

    Args:
        table: detections with the columns time (s) or frame, id, x, y (m), or what such columns may be called
            in CSV files. Levels of the index that have names count as columns. Times may be dates. Ids may be
            anything that is not missing. Rows without a position (NaN, None) are missing detections, and left
            out; so are rows of a class that is no person.
        occupancy: static obstacles in the same frame, or the path of a map; None: free ground.
        rate_hz: frames per second, where there are frames.
        unit: of lengths: "m", "cm", "mm", "ft" or "inch".
        columns: quantity -> title, where titles are others, such as {"id": "agent"}.
        classes: which classes are people.
        any_speed: accept people who are faster than people walk, with a warning.
        model: a model folder; None: the default one.

    Returns:
        A row per person, time, mode and step: track (the id), time (of the detection, s), mode, weight, step
        (from 1, 0.3 s apart for the default model), x, y (m, world frame).

    Raises:
        ValueRuleError: an argument is something else.
        InputError: a column is missing, a value is not a number, or people would move at impossible speeds.
    """
    checked: object = table
    if not isinstance(checked, pd.DataFrame):
        raise ValueRuleError("table", checked, "it must be a DataFrame of pandas")
    if isinstance(occupancy, str | Path):
        occupancy = read_ground_at(Path(occupancy))
    checked = occupancy
    if not isinstance(checked, OccupancyMap | None):
        raise ValueRuleError("occupancy", checked, "it must be an OccupancyMap, a path or None")
    how = ReadOptions(columns, rate_hz, unit, classes=tuple(classes), any_speed=any_speed)
    with add_path(_TABLE):
        content, ids = from_frame(table, how)
        people = to_tracks(str(_TABLE), content, how).people
        dt_s = check(people, str(_TABLE), agreed_unit(content.unit, how), any_speed)
    scene = Scene("table", people, occupancy or OccupancyMap.free_around(people.position), dt_s)
    checked_placement(scene)
    predictor = predictor_for(scene, None if model is None else Path(model))
    windows = as_windows(scene, replay_scene(scene, predictor), METHOD, predictor.protocol)
    forecasts = forecast_table(windows, METHOD)
    return forecasts.assign(track=ids.take(forecasts["track"].to_numpy()))
