"""Real places side by side: networks that never saw them, trained in each way, beside the other methods."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from pedpred.report.document import Block, Cell, Picture, Pictures, Row, Section, Table, Text
from pedpred.report.gather import Evaluated
from pedpred.report.methods import Method, Methods
from pedpred.report.results import COLUMNS, Result
from pedpred.report.sections import warnings
from pedpred.report.tables import interval, metric_title, pivot, study_cell
from pedpred.report.walls import gains_figure, wall_pictures

SHORT = {"transfer": "simulated", "real": "tuned"}
TRAINED = {
    "sim": "simulated rooms",
    "transfer": "trained in simulation only",
    "real": "fine-tuned on the other places",
}
"""What the networks of a study have learned from, in a word and in words; another study has its name."""
REAL, STAND_IN = "real places that it never saw", "simulated people in place of recordings"
_RELATIVE = ("ratio", "named", "best", "base", "share")
_LISTED = (
    *("ade_m", "moving_ade_m", "standing_ade_m", "stopping_ade_m", "starting_ade_m"),
    *("min_ade_m_k6", "nll", "obstacle_share"),
)

Studies = Mapping[str, Sequence[Result]]
"""Results at real places by study."""


def places_section(evaluated: Sequence[Evaluated], methods: Methods) -> Section:
    """Compare all studies of real places: errors, forecasts at walls, errors over the share of these."""
    real = [study for study in evaluated if study.kind == "real"]
    measured = [study for study in real if study.results]
    stand_ins = {name: how for study in real for name, how in study.stand_ins.items()}
    missing = {name: how for study in real for name, how in study.missing.items()}
    blocks: list[Block] = [*warnings([], missing, stand_ins)]
    if measured:
        studies = {study.study: study.results for study in measured}
        said = [
            wins(studies, method, methods, bool(stand_ins))
            for method in (methods.main, *methods.networks[:-1])
        ]
        blocks += [Text(said[0], "sentence"), ratios_table(studies, methods)]
        blocks += [Text(words, "note") for words in said[1:]]
        if walls := wall_pictures(measured[0], trained(measured[0].study, measured[0].results), methods):
            blocks.append(Pictures(walls))
        blocks.append(_gains(evaluated, methods))
        tables = [Section(metric_title(key), [places_table(studies, key, methods)]) for key in _LISTED]
        blocks.append(Section("Every place, with 95 % intervals", tables, folded=True))
    title = STAND_IN[0].upper() + STAND_IN[1:] if stand_ins else "Real places, each unseen"
    return Section(title, blocks, "places")


def relative_errors(results: Iterable[Result], methods: Methods) -> pd.DataFrame:
    """ADE of each method / that of the best simple one, at each place or in each scene of a pooled test set.

    A place where the best simple method is exact, as on made-up straight lines, or where none was evaluated,
    has no ratio and is left out.

    Returns:
        Rows of the table of results with the `ratio`, the `best` simple method, its ADE `base`, the `share`
        of straight forecasts' points in obstacles, NaN if unknown, and `named`: its name is drawn.
    """
    rows = []
    for result in results:
        for figures in result.parts.values() if result.parts else [result.figures]:
            best = figures.least(method.key for method in methods.simple)
            straight = figures.get(methods.simple[0].key, "obstacle_share")
            if best is None or not (base := figures.value(best)):
                continue
            errors = figures.frame[figures.frame["figure"] == "ade_m"]
            known = {"best": best, "base": base, "share": straight.value if straight else np.nan}
            rows.append(errors.assign(ratio=errors["value"] / base, named=not result.parts, **known))
    return pd.concat(rows) if rows else pd.DataFrame(columns=[*COLUMNS, *_RELATIVE])


def wins(studies: Studies, method: Method, methods: Methods, stand_ins: bool = False) -> str:
    """At how many places a method has a smaller ADE than the best simple method, and its range."""
    counts = []
    for study, results in studies.items():
        ratios = relative_errors(results, methods).query("method == @method.key")["ratio"]
        if len(ratios):
            span, how = f"{ratios.min():.2f} to {ratios.max():.2f}", trained(study, results)
            counts.append(f"at {(ratios < 1).sum()} of {len(ratios)} when {how} ({span} times its ADE)")
    if not counts:
        return f"The {method.label} was evaluated at no real place."
    where = f"With {STAND_IN}" if stand_ins else f"At {REAL}"
    label = f'"{method.label}"' if "," in method.label else method.label
    return f"{where}, the {label} beats {methods.best_simple} {' and '.join(counts)}."


def ratios_table(studies: Studies, methods: Methods) -> Table:
    """ADE of every method relative to the best simple one, place by place; ratios below 1 are strong.

    The main method comes first; a simple one has a column if it is the best one somewhere.
    """
    every = [result for results in studies.values() for result in results]
    frame, columns = _by_column(relative_errors(every, methods), studies, methods)
    best = frame.drop_duplicates("place").set_index("place")["best"]
    shown = [c for c in columns if methods[c[0]].learned or c[0] in set(best)]
    shown.sort(key=lambda column: -methods.rows.index(methods[column[0]]))

    def ratio_cell(row: Any) -> Cell:
        words = f"ADE {row.value:.3f} m, 95 % interval {interval((row.low, row.high))} m"
        return Cell(f"{row.ratio:.2f}", remark=words, strong=row.ratio < 1)

    cells = pivot(frame, ["place", "column"], best.index, shown, ratio_cell)
    rows = []
    for place, ratios in zip(best.index, cells, strict=True):
        ((base,),) = pivot(frame, ["place", "method"], [place], [best[place]], study_cell)
        rows.append(Row([Cell(place), base, *ratios]))
    header = ["ADE / that of the best simple method", "best simple ADE [m]"]
    return Table([*header, *_titles(shown, studies, methods)], rows)


def places_table(studies: Studies, key: str, methods: Methods) -> Table:
    """A metric of every method at every place; one with weights has a column for each study."""
    every = pd.concat([result.figures.frame for results in studies.values() for result in results])
    frame, columns = _by_column(every[every["step"] == 0], studies, methods)
    places = frame["place"].unique()
    cells = pivot(frame[frame["figure"] == key], ["place", "column"], places, columns, study_cell)
    rows = [Row([Cell(place), *own]) for place, own in zip(places, cells, strict=True)]
    return Table([metric_title(key), *_titles(columns, studies, methods)], rows)


def _by_column(
    frame: pd.DataFrame, studies: Studies, methods: Methods
) -> tuple[pd.DataFrame, list[tuple[str, str]]]:
    """Add the `column` of each figure: (method, study), the study only of one with weights; list them all."""
    learned = {key: methods[key].learned for key in frame["method"].unique()}
    pairs: Any = zip(frame["method"], frame["study"], strict=True)
    own: Any = [(method, study if learned[method] else "") for method, study in pairs]
    columns = [(m, s) for m in methods.ordered(learned) for s in (studies if learned[m] else [""])]
    return frame.assign(column=own), columns


def _titles(columns: Sequence[tuple[str, str]], studies: Studies, methods: Methods) -> list[str]:
    short = {study: SHORT.get(_training(study, results), study) for study, results in studies.items()}
    several = len(studies) > 1
    return [methods[m].label + (f", {short[s]}" if s and several else "") for m, s in columns]


def _gains(evaluated: Sequence[Evaluated], methods: Methods) -> Pictures:
    """The picture of gains; none where nothing has a gain."""
    main, straight = methods.main, methods.simple[0]
    errors = [
        relative_errors(study.results, methods).assign(group=trained(study.study, study.results))
        for study in evaluated
        if study.results
    ]
    gains = pd.concat(errors).query("method == @main.key").dropna(subset="share")
    if gains.empty:
        return Pictures([])
    gains = gains.assign(low=gains["low"] / gains["base"], high=gains["high"] / gains["base"])
    where = STAND_IN if any(study.stand_ins for study in evaluated) else "real places"
    caption = (
        f"ADE of the {main.label} relative to the best simple method, over the share of {straight.label}'s "
        f"points in obstacles: {where} and single simulated rooms. Lines: 95 % interval of the "
        f"{main.label}'s ADE."
    )
    return Pictures([Picture("walls", caption, gains_figure(gains, methods))])


def trained(study: str, results: Iterable[Result]) -> str:
    """What the networks of some results have learned from, in words."""
    training = _training(study, results)
    return TRAINED.get(training, training)


def _training(study: str, results: Iterable[Result]) -> str:
    """The study whose words say what the networks of some results have learned from.

    Without the sets that would fine-tune them, they are those of the simulation.
    """
    real = [result for result in results if result.kind == "real"]
    return study if not real or any(result.fine_tuned for result in real) else "transfer"
