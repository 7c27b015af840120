"""Real places side by side: networks that never saw them, trained in each way, beside the other methods."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pedpred.report.document import NOTHING, Block, Cell, Picture, Pictures, Row, Section, Table, Text
from pedpred.report.gallery import Evaluated
from pedpred.report.measures import Result
from pedpred.report.methods import Method, Methods
from pedpred.report.sections import warnings
from pedpred.report.tables import interval, metric_cell, metric_title
from pedpred.report.walls import (
    LEAST_SHARE,
    best_simple,
    gains,
    gains_figure,
    wall_caption,
    wall_figure,
    wall_windows,
)

SHORT = {"transfer": "simulated", "real": "tuned"}
TRAINED = {
    "sim": "simulated rooms",
    "transfer": "trained in simulation only",
    "real": "fine-tuned on the other places",
}
"""What the networks of a study have learned from, in a word and in words; another study has its name."""
REAL, STAND_IN = "real places that it never saw", "simulated people in place of recordings"
_LISTED = ("ade_m", "moving_ade_m", "standing_ade_m", "min_ade_m_k6", "nll", "obstacle_share")

Studies = Mapping[str, Mapping[str, Result]]
"""Results at real places: study -> place -> result."""
Columns = Sequence[tuple[Method, Sequence[str]]]
"""Methods with the studies that their figures may come from: one of a method with weights, any of others."""


def places_section(evaluated: Sequence[Evaluated], methods: Methods) -> Section:
    """Compare all studies of real places: errors, forecasts at walls, errors over the share of these."""
    real = [study for study in evaluated if study.kind == "real"]
    studies = {
        study.study: {result.name: result for result in study.results} for study in real if study.results
    }
    missing = {name: how for study in real for name, how in study.missing.items()}
    stand_ins = {name: how for study in real for name, how in study.stand_ins.items()}
    blocks: list[Block] = [*warnings([], missing, stand_ins)]
    if studies:
        told = (methods.main, *methods.networks[:-1])
        said = [wins(studies, method, methods, bool(stand_ins)) for method in told]
        blocks += [Text(said[0], "sentence"), ratios_table(studies, methods)]
        blocks += [Text(words, "note") for words in said[1:]]
        walls = wall_pictures(next(study for study in real if study.results), methods)
        blocks += [Pictures(walls)] if walls else []
        blocks.append(_gains(evaluated, methods))
        tables = [Section(metric_title(key), [places_table(studies, key, methods)]) for key in _LISTED]
        blocks.append(Section("Every place, with 95 % intervals", tables, folded=True))
    title = STAND_IN[0].upper() + STAND_IN[1:] if stand_ins else "Real places, each unseen"
    return Section(title, blocks, "places")


def wins(studies: Studies, method: Method, methods: Methods, stand_ins: bool = False) -> str:
    """At how many places a method has a smaller ADE than the best simple method, and its range."""
    counts = []
    for study, results in studies.items():
        ratios = [gain.ratio for gain in gains(results.values(), study, methods, method)]
        if ratios:
            won, span = sum(ratio < 1 for ratio in ratios), f"{min(ratios):.2f} to {max(ratios):.2f}"
            trained = _trained(study, results.values())
            counts.append(f"at {won} of {len(ratios)} when {trained} ({span} times its ADE)")
    if not counts:
        return f"The {method.label} was evaluated at no real place."
    where = f"With {STAND_IN}" if stand_ins else f"At {REAL}"
    label = f'"{method.label}"' if "," in method.label else method.label
    return f"{where}, the {label} beats {methods.best_simple} {' and '.join(counts)}."


def ratios_table(studies: Studies, methods: Methods) -> Table:
    """ADE of every method relative to the best simple one, place by place; ratios below 1 are strong.

    The main method comes first; a simple one has a column if it is the best one somewhere.
    """
    places = _figures(studies)
    best = {name: key for name, figures in places.items() if (key := best_simple(figures, methods))}
    columns = [
        (method, any_of)
        for method, any_of in _columns(studies, methods)
        if method.learned or method.key in best.values()
    ]
    columns.sort(key=lambda column: -methods.rows.index(column[0]))
    rows = []
    for name, key in best.items():
        base, base_m = places[name][key], places[name][key]["ade_m"]
        study = next(study for study, results in studies.items() if name in results)
        cells = [Cell(name), metric_cell(f"{study}.{name}", key, "ade_m", base, shown=True)]
        for method, any_of in columns:
            _, metrics = _entry(studies, name, method, any_of)
            if not metrics or not base_m:  # nothing relates to an exact forecast
                cells.append(Cell(NOTHING))
                continue
            ratio = metrics["ade_m"] / base_m
            words = f"ADE {metrics['ade_m']:.3f} m, 95 % interval {interval(metrics['ade_m_ci95'])} m"
            cells.append(Cell(f"{ratio:.2f}", remark=words, strong=ratio < 1))
        rows.append(Row(cells))
    header = ["ADE / that of the best simple method", "best simple ADE [m]", *_titles(columns, studies)]
    return Table(header, rows)


def places_table(studies: Studies, key: str, methods: Methods) -> Table:
    """A metric of every method at every place; one with weights has a column for each study."""
    columns = _columns(studies, methods)
    rows = []
    for name in _figures(studies):
        cells = [Cell(name)]
        for method, any_of in columns:
            study, metrics = _entry(studies, name, method, any_of)
            cells.append(metric_cell(f"{study}.{name}", method.key, key, metrics, shown=True))
        rows.append(Row(cells))
    return Table([metric_title(key), *_titles(columns, studies)], rows)


def _figures(studies: Studies) -> dict[str, Mapping[str, Any]]:
    """The figures of the first study that has a place, by place."""
    figures: dict[str, Mapping[str, Any]] = {}
    for results in studies.values():
        figures |= {name: result.figures for name, result in results.items() if name not in figures}
    return figures


def _columns(studies: Studies, methods: Methods) -> Columns:
    keys = {key for results in studies.values() for result in results.values() for key in result.figures}
    every: list[Sequence[str]] = [[study] for study in studies]
    shown = [methods[key] for key in methods.ordered(keys)]
    return [(m, any_of) for m in shown for any_of in (every if m.learned else [list(studies)])]


def _titles(columns: Columns, studies: Studies) -> list[str]:
    short = {
        study: SHORT.get(_training(study, results.values()), study) for study, results in studies.items()
    }
    return [m.label + (f", {short[s[0]]}" if len(s) < len(studies) else "") for m, s in columns]


def _entry(
    studies: Studies, place: str, method: Method, any_of: Sequence[str]
) -> tuple[str, Mapping[str, Any]]:
    """The first study of a place with figures of a method, and these; empty ones if there is none."""
    for study in any_of:
        if place in studies[study] and method.key in studies[study][place].figures:
            return study, studies[study][place].figures[method.key]
    return "", {}


def wall_pictures(evaluated: Evaluated, methods: Methods) -> list[Picture]:
    """Forecasts at the places where straight ones often meet walls."""
    pictures = []
    for result in evaluated.results:
        straight = result.figures.get(methods.simple[0].key, {})
        if not _drawn(evaluated, result.name, methods) or straight.get("obstacle_share", 0.0) < LEAST_SHARE:
            continue
        scene, windows = evaluated.scene(result.name), evaluated.windows[result.name]
        rows = wall_windows(windows, scene, methods)
        trained = _trained(evaluated.study, evaluated.results)
        caption = f"{wall_caption(scene, windows, methods)} Networks: {trained}."
        figure = wall_figure(scene, windows, rows, methods)
        pictures.append(Picture(f"walls_{result.name}", caption, figure))
    return pictures


def _drawn(evaluated: Evaluated, place: str, methods: Methods) -> bool:
    """Whether the two methods of the pictures were evaluated at a place."""
    windows = evaluated.windows.get(place)
    return windows is not None and {methods.main.key, methods.simple[0].key} <= windows.predictions.keys()


def _gains(evaluated: Sequence[Evaluated], methods: Methods) -> Pictures:
    """The picture of gains; none where nothing has a gain."""
    main, straight = methods.main, methods.simple[0]
    gained = [
        gain
        for study in evaluated
        for gain in gains(study.results, _trained(study.study, study.results), methods, main)
    ]
    gained = [gain for gain in gained if not math.isnan(gain.share)]
    if not gained:
        return Pictures([])
    where = STAND_IN if any(study.stand_ins for study in evaluated) else "real places"
    caption = (
        f"ADE of the {main.label} relative to the best simple method, over the share of {straight.label}'s "
        f"points in obstacles: {where} and single simulated rooms. Lines: 95 % interval of the "
        f"{main.label}'s ADE."
    )
    return Pictures([Picture("walls", caption, gains_figure(gained, methods))])


def _training(study: str, results: Iterable[Result]) -> str:
    """The study whose words say what the networks of some results have learned from.

    Without the sets that would fine-tune them, they are those of the simulation.
    """
    real = [result for result in results if result.kind == "real"]
    return study if not real or any(result.fine_tuned for result in real) else "transfer"


def _trained(study: str, results: Iterable[Result]) -> str:
    training = _training(study, results)
    return TRAINED.get(training, training)
