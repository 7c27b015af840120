"""All figures in one table, and the test sets that they are about.

The metric files, reports/metrics/<study>.json, are {place: {method: {figure: value}}}; the 95 % interval of a
figure stands beside it as `<figure>_ci95`. Tables, plots and sentences are made of the rows of this table.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from pedpred.errors import InputError, ValueRuleError
from pedpred.files import read_json, translate_errors

COLUMNS = ("study", "place", "method", "figure", "step", "value", "low", "high")
"""A row per figure. `study` is the name of the metric file; `step` is 0, or that of a figure that has a value
for each step of the forecast, from 1; `low` and `high` are the 95 % interval, NaN where there is none."""
REFERENCE_GAP = "_minus_reference"
"""Ending of the figures that are paired differences to the reference method."""
ADE_GAP = f"ade_m{REFERENCE_GAP}"

_INTERVAL = "_ci95"
STEPS = ("per_step_m", "per_step_q25_m", "per_step_q50_m", "per_step_q75_m")
"""Mean and quartiles of the error at each step."""
NEEDED = ("ade_m", f"ade_m{_INTERVAL}", "windows", "tracks", *STEPS)
"""What every method in a metric file must have."""
_MANY = 3


class Figure(NamedTuple):
    """A figure with its 95 % interval, None where there is none."""

    value: float
    bounds: tuple[float, float] | None


def metrics_now(folder: Path) -> dict[str, Any]:
    """Read the metric files of a folder, by name.

    Raises:
        InputError: one of them is damaged.
    """
    return {
        path.stem: read_json(path, partial(InputError, path, "file", remedy="Write it again"))
        for path in sorted(folder.glob("*.json"))
    }


def read_metrics(path: Path) -> dict[str, Any]:
    """Read a metric file.

    Raises:
        InputError: it is no JSON, or a method lacks a figure; the error names it.
    """
    wording = partial(InputError, path, "file")
    places: dict[str, Any] = read_json(path, wording)
    with translate_errors(wording):
        for place, methods in places.items():
            for method, figures in methods.items():
                missing = [name for name in NEEDED if name not in figures]
                if missing:
                    raise InputError(path, f"{place}/{method}/{missing[0]}", "it is missing")
    return places


def results_frame(metrics: Mapping[str, Any]) -> pd.DataFrame:
    """Make the table of the contents of metric files, study -> contents.

    Contents of another form, as of walking.json, have no rows; neither have figures that are null.
    """
    return pd.DataFrame(_rows(metrics), columns=COLUMNS).astype({"value": float, "low": float, "high": float})


def _rows(metrics: Mapping[str, Any]) -> Iterator[tuple[Any, ...]]:
    for study, places in metrics.items():
        for place, methods in _items(places):
            for method, figures in _items(methods):
                for figure, found in _items(figures):
                    if figure.endswith(_INTERVAL):
                        continue
                    bounds = figures.get(f"{figure}{_INTERVAL}") or (None, None)
                    steps = enumerate(found, 1) if isinstance(found, list) else [(0, found)]
                    for step, value in steps:
                        if isinstance(value, int | float):
                            yield study, place, method, figure, step, value, *bounds


def _items(node: Any) -> Iterable[tuple[str, Any]]:
    return node.items() if isinstance(node, Mapping) else ()


def figure_of(row: Any) -> Figure:
    """The figure in a row of the table."""
    bounds = None if pd.isna(row.low) or pd.isna(row.high) else (float(row.low), float(row.high))
    return Figure(float(row.value), bounds)


class Figures:
    """The figures of one place in one study, by method."""

    def __init__(self, frame: pd.DataFrame):
        """Rows of the table that are about one place."""
        self.frame = frame

    @cached_property
    def methods(self) -> list[str]:
        """Keys of the methods that were evaluated."""
        return list(self.frame["method"].unique())

    @cached_property
    def _found(self) -> dict[tuple[str, str], Figure]:
        whole = self.frame[self.frame["step"] == 0]
        return {(row.method, row.figure): figure_of(row) for row in whole.itertuples()}

    def get(self, method: str, figure: str) -> Figure | None:
        """A figure of a method; None where it was not measured."""
        return self._found.get((method, figure))

    def value(self, method: str, figure: str = "ade_m") -> float:
        """The value of a figure that was measured."""
        return self._found[method, figure].value

    def ade_bounds(self, method: str) -> tuple[float, float]:
        """The 95 % interval of the ADE, m."""
        bounds = self._found[method, "ade_m"].bounds
        assert bounds is not None, "every ADE has an interval"
        return bounds

    def over_steps(self, figure: str) -> pd.DataFrame:
        """A figure over the horizon: a row per step, a column per method that has it."""
        rows = self.frame[(self.frame["figure"] == figure) & (self.frame["step"] > 0)]
        return rows.pivot(index="step", columns="method", values="value")

    def least(self, methods: Iterable[str]) -> str | None:
        """The one of some methods with the least ADE; None where none was evaluated."""
        known = [method for method in methods if method in self.methods]
        return min(known, key=self.value, default=None)


@dataclass(frozen=True, eq=False)
class Result:
    """What was measured in one test set; `parts` are its single scenes by name, where it pools several."""

    name: str
    study: str  # that it belongs to: the name of its metric file
    kind: str  # of test set, "simulated" or "real"
    place: str  # the test set in words, with what its networks were trained on, as in "at home (...)"
    figures: Figures
    dt_s: float  # between two steps of the forecasts, s
    parts: Mapping[str, Figures]
    fine_tuned: bool = False  # whether its networks were, on sets that are here

    @property
    def title(self) -> str:
        """The place as a heading."""
        return self.place[0].upper() + self.place[1:]

    @property
    def noncausal(self) -> bool:
        """Whether these are figures of the protocol whose inputs know the future."""
        marks = (self.figures.get(method, "noncausal") for method in self.figures.methods)
        return any(mark is not None and mark.value for mark in marks)


def results_of(
    metrics: Mapping[str, Any],
    folds: Iterable[Mapping[str, Sequence[str]]],
    study: str,
    dt_s: float,
    missing: Collection[str] = (),
) -> list[Result]:
    """The test sets of the folds of a study, in their order; see `Result` for the arguments.

    A fold has `test` and, where networks were fine-tuned for it, `train`: sets named <kind>/<name>. In the
    metrics, single scenes of a test set are named `<test set>_<scene>`. Sets without recording, `missing`,
    are left out.

    Raises:
        ValueRuleError: a test set has no figures.
    """
    frame = results_frame({study: metrics})
    places = {str(place): Figures(rows) for place, rows in frame.groupby("place", sort=False)}
    folds, results = list(folds), []
    tested = {entry.split("/")[1] for fold in folds for entry in fold["test"]}
    owner = {  # the longest name fits: `hall_wide_a` is a scene of `hall_wide`, neither is one of `hall`
        place: max((name for name in tested if place.startswith(f"{name}_")), key=len, default="")
        for place in places.keys() - tested
    }
    for fold in folds:
        trained = [entry for entry in fold.get("train", ()) if entry not in missing]
        for kind, name in (entry.split("/") for entry in fold["test"] if entry not in missing):
            if name not in places:
                raise ValueRuleError("metrics", sorted(places), f"the test set {name!r} must be among them")
            place = "in simulated rooms that no training saw" if kind == "simulated" else f"at {name}"
            parts = {p.removeprefix(f"{name}_"): own for p, own in places.items() if owner.get(p) == name}
            words, tuned = place + _tuned(trained), bool(trained)
            results.append(Result(name, study, kind, words, places[name], dt_s, parts, tuned))
    return results


def _tuned(sets: Sequence[str]) -> str:
    """The places that networks were fine-tuned on, in brackets; more than two are counted."""
    names = [name for kind, name in (entry.split("/") for entry in sets) if kind == "real"]
    words = " and ".join(names) if len(names) < _MANY else f"{len(names)} other recordings"
    return f" (fine-tuned on {words})" if names else ""
