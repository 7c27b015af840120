"""Real places side by side: networks that never saw them, trained in each way, beside the other methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pedpred.forecasting import Methods
from pedpred.report.document import Block, Cell, Picture, Pictures, Row, Section, Table, Text
from pedpred.report.gallery import Evaluated
from pedpred.report.measures import Result
from pedpred.report.sections import warnings
from pedpred.report.tables import metric_cell, metric_title
from pedpred.report.walls import (
    LEAST_SHARE,
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
    "real": "then fine-tuned on the other places",
}
"""What the networks of a study have learned from, in a word and in words; another study has its name."""
_FURTHER = ("moving_ade_m", "standing_ade_m", "obstacle_share")

Studies = Mapping[str, Mapping[str, Result]]
"""Results at real places: study -> place -> result."""


def places_section(evaluated: Sequence[Evaluated], methods: Methods) -> Section:
    """Compare all studies of real places: table, forecasts at walls, errors over the share of these."""
    real = [own for own in evaluated if own.kind == "real"]
    studies = {own.study: {result.name: result for result in own.results} for own in real if own.results}
    missing = list(dict.fromkeys(name for own in real for name in own.missing))
    blocks: list[Block] = [*warnings([], missing)]
    if studies:
        blocks += [
            Text(relative_errors(studies, methods), "sentence"),
            places_table(studies, "ade_m", methods),
        ]
        walls = wall_pictures(next(own for own in real if own.results), methods)
        blocks += [Pictures(walls)] if walls else []
        blocks.append(_gains(evaluated, methods))
        tables = [Section(metric_title(key), [places_table(studies, key, methods)]) for key in _FURTHER]
        blocks.append(Section("Moving, standing, in obstacles", tables, folded=True))
    return Section("Real places, each unseen", blocks, "places")


def relative_errors(studies: Studies, methods: Methods) -> str:
    """The main method's error relative to the best simple method, place by place."""
    *some, last = (method.label for method in methods.simple)
    parts = []
    for study, results in studies.items():
        gain = {gain.name: f"{gain.ratio - 1:+.0%}" for gain in gains(results.values(), study, methods)}
        listed = ", ".join(f"{name} {percent.replace('%', ' %')}" for name, percent in gain.items())
        parts.append(f"{_short(study)} ({_trained(study)}): {listed}")
    against = f"the ADE of the {methods.main.label} minus that of the best of {', '.join(some)} and {last}"
    return f"At places that it never saw, {against}; {'; '.join(parts)}."


def places_table(studies: Studies, key: str, methods: Methods) -> Table:
    """A metric of every method at every place; one with weights has a column for each study."""
    names = list(dict.fromkeys(name for results in studies.values() for name in results))
    keys = {m for results in studies.values() for own in results.values() for m in own.figures}
    columns: list[tuple[str, list[str]]] = []  # each with the studies that any of its figures may come from
    for method in methods.ordered(keys):
        learned = methods[method].role in ("ablation", "network")
        columns += [(method, [study]) for study in studies] if learned else [(method, list(studies))]
    rows = []
    for name in names:
        cells = [Cell(name)]
        for method, any_of in columns:
            study = next((study for study in any_of if name in studies[study]), None)
            own = {} if study is None else studies[study][name].figures.get(method, {})
            cells.append(metric_cell(f"{study}.{name}", method, key, own, shown=True))
        rows.append(Row(cells))
    header = [
        methods[method].label + (f", {_short(any_of[0])}" if len(any_of) < len(studies) else "")
        for method, any_of in columns
    ]
    return Table([metric_title(key), *header], rows)


def wall_pictures(evaluated: Evaluated, methods: Methods) -> list[Picture]:
    """Forecasts at the places where straight ones often meet walls."""
    found = []
    for result in evaluated.results:
        straight = result.figures.get(methods.simple[0].key, {})
        if result.name not in evaluated.windows or straight.get("obstacle_share", 0.0) < LEAST_SHARE:
            continue
        scene, windows = evaluated.scene(result.name), evaluated.windows[result.name]
        rows = wall_windows(windows, scene, methods)
        caption = f"{wall_caption(scene, methods)} Networks: {_trained(evaluated.study)}."
        figure = wall_figure(scene, windows, rows, methods)
        found.append(Picture(f"walls_{result.name}", caption, figure))
    return found


def _gains(evaluated: Sequence[Evaluated], methods: Methods) -> Pictures:
    found = [gain for own in evaluated for gain in gains(own.results, _trained(own.study), methods)]
    caption = (
        f"ADE of the {methods.main.label} relative to the best simple method, over the share of "
        f"{methods.simple[0].label}'s points in obstacles: real places and single simulated rooms. Lines: "
        f"95 % interval of the {methods.main.label}'s ADE."
    )
    return Pictures([Picture("walls", caption, gains_figure(found, methods))])


def _short(study: str) -> str:
    return SHORT.get(study, study)


def _trained(study: str) -> str:
    return TRAINED.get(study, study)
