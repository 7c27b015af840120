"""Sections that pages share: results in words and tables, expectations, calibration, comparisons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

import pandas as pd

from pedpred.report.document import NOTHING, Block, Cell, Picture, Pictures, Row, Section, Table, Text
from pedpred.report.findings import Paper, better_than, in_the_noise, judge_expectations, sum_up
from pedpred.report.methods import Methods
from pedpred.report.results import ADE_GAP, Figures, Result
from pedpred.report.tables import (
    calibration_table,
    findings_table,
    further_table,
    interval,
    method_row,
    metric_cell,
    metric_keys,
    metrics_table,
    pivot,
    scenes_table,
)

READING = (
    "ADE: distance to the true position, averaged over all steps; FDE: at the last step; intervals: "
    "bootstrap over tracks; in obstacles: share of forecast positions; collisions: share of forecasts that "
    "come closer to another one than the collision distance. Where a method gives several weighted paths, "
    "minADE6 is the ADE of the best of the six most likely ones, a miss is a best one of these that ends "
    "more than 2 m off, and NLL the negative log likelihood of the true positions, lower is better."
)
CALIBRATION = (
    "Some methods give a probability density of the position at every step: a Gaussian, or several weighted "
    "ones. Its smallest regions that hold 50, 90 and 95 % should include that share of the true positions: a "
    "smaller share means overconfidence, a larger one underconfidence. NLL: negative log likelihood of the "
    "true position; lower: tighter and better calibrated. The networks learn their densities in training; "
    "that of the Kalman filter follows from its noise."
)
NONCAUSAL = "**Non-causal protocol: the inputs know the future, so nothing on this page is a forecast.**"


def warnings(
    results: Sequence[Result],
    missing: Mapping[str, str] = MappingProxyType({}),
    stand_ins: Mapping[str, str] = MappingProxyType({}),
) -> list[Block]:
    """What a reader must know first.

    Args:
        results: what the page is about.
        missing: places whose recordings were not available, and how to get them.
        stand_ins: places whose people are simulated because no recording was available, and how.
    """
    blocks: list[Block] = [Text(NONCAUSAL, "warning")] if any(result.noncausal for result in results) else []
    if stand_ins:
        made = "; ".join(f"{name}, {how}" for name, how in stand_ins.items())
        words = "say nothing about real people"
        blocks.append(Text(f"**In place of recordings: {made}.** Its figures {words}.", "warning"))
    if missing:
        left_out = f"Not available, hence neither trained on nor tested: {', '.join(missing)}."
        blocks.append(Text(f"**{left_out}**", "warning"))
        rows = [Row([Cell(name), Cell(how)]) for name, how in missing.items()]
        blocks.append(Table(["place", "recording"], rows))
    return blocks


def answer(result: Result, methods: Methods) -> str:
    """One sentence: the error of the main method, and whether it is below the reference's."""
    main, reference, figures, start = methods.main, methods.reference, result.figures, result.title
    if main.key not in figures.methods:
        return f"{start}, the {main.label} was not evaluated."
    error_m, horizon_s = figures.value(main.key), len(figures.over_steps("per_step_m")) * result.dt_s
    text = (
        f"{start}, the {main.label} has an ADE of {error_m:.3f} m over "
        f"{horizon_s:.0f} s (95 % interval {interval(figures.ade_bounds(main.key))} m; "
        f"{figures.value(main.key, 'windows'):.0f} windows of {figures.value(main.key, 'tracks'):.0f} tracks)"
    )
    if reference.key not in figures.methods:
        return text + f"; the {reference.label} was not evaluated."
    other_m, gap = figures.value(reference.key), figures.get(main.key, ADE_GAP)
    gain, than = better_than(error_m, other_m), f"the {reference.label}'s {other_m:.3f} m"
    words = ""
    if gap is not None and gap.bounds is not None and main != reference:
        words = f"difference {gap.value:+.3f} m, interval {interval(gap.bounds, '+')} m"
    if in_the_noise(figures, main.key):
        return f"{text}, not distinguishable from {than} ({gain}; {words})."
    return f"{text}, {gain} than {than}{f' ({words})' if words else ''}."


def answer_section(result: Result, methods: Methods) -> Section:
    """The result of a test set with its metrics."""
    blocks: list[Block] = [Text(answer(result, methods), "sentence"), metrics_table(result, methods)]
    if metric_keys(result.figures)[1]:
        blocks.append(Section("Further metrics", [further_table(result, methods)], folded=True))
    return Section(result.title, blocks)


def expectations_section(results: Sequence[Result], methods: Methods, paper: Paper) -> Section:
    """What was expected, and what was found."""
    findings = [finding for result in results for finding in judge_expectations(result, paper, methods)]
    return Section("Expected and found", [Text(sum_up(findings)), findings_table(findings)], folded=True)


def parts_sections(results: Sequence[Result], methods: Methods) -> list[Section]:
    """Single scenes of pooled test sets."""
    sections = []
    for result in (result for result in results if result.parts):
        wins = Text(f"ADE, m. {below_in(result.parts.values(), methods)}")
        sections.append(Section("Single scenes", [wins, scenes_table(result, methods)], folded=True))
    return sections


def below_in(scenes: Iterable[Figures], methods: Methods) -> str:
    """In how many scenes the ADE of the main method, and of networks with ablations, is below others'."""
    main, scenes = methods.main, list(scenes)
    pairs = [(main, other) for other in (methods.reference, *methods.networks) if other is not main]
    counts = []
    for one, other in [*pairs, *((whole, part) for part, whole in methods.ablations)]:
        both = [figures for figures in scenes if {one.key, other.key} <= set(figures.methods)]
        won = sum(figures.value(one.key) < figures.value(other.key) for figures in both)
        if both:
            counts.append(f"{one.label} below {other.label} in {won} of {len(both)}")
    return f"{'; '.join(counts)}." if counts else ""


def calibration_section(
    results: Sequence[Result], methods: Methods, pictures: Sequence[Picture]
) -> list[Section]:
    """Coverage of the regions; nothing where no method gives covariances."""
    tables = [(result, calibration_table(result, methods)) for result in results]
    blocks: list[Block] = [Section(result.title, [table]) for result, table in tables if table]
    if not blocks:
        return []
    return [Section("Calibration", [Text(CALIBRATION), *blocks, Pictures(pictures)], "calibration")]


def paper_section(results: Sequence[Result], methods: Methods, paper: Paper) -> list[Section]:
    """ADE of every method beside the paper's, test set by test set; nothing where it has no figures."""
    shown = [result for result in results if paper.errors_m(result)]
    if not shown:
        return []
    frame = pd.concat([result.figures.frame for result in shown])
    names = methods.ordered(frame["method"])
    header, columns, studies = ["ADE [m]"], list[list[Cell]](), {result.study: None for result in shown}
    for study in studies:
        places = [result.name for result in shown if result.study == study]
        theirs = [paper.ade_m[study].get(name) for name in names]
        header += [f"paper, {study}", *(f"here, {place}" for place in places)]
        columns.append([Cell(NOTHING if error is None else f"{error:.3f}") for error in theirs])
        ours = frame[(frame["study"] == study) & (frame["figure"] == "ade_m")]
        columns += pivot(ours, ["place", "method"], places, names, metric_cell)
    rows = [method_row(n, own, methods) for n, own in zip(names, zip(*columns, strict=True), strict=True)]
    remarks = [Text(paper.remarks[study], "note") for study in studies if study in paper.remarks]
    remarks.append(Text("The paper's figures were measured on its own windows.", "note"))
    return [Section("Beside the paper's table", [*remarks, Table(header, rows)], "paper")]


def latency_section(updates: Sequence[Mapping[str, float]]) -> list[Section]:
    """Time per update over the size of the crowd; nothing if it was not measured."""
    if not updates:
        return []
    rows = []
    for rank, row in enumerate(updates):
        cells = [Cell(f"{row[k]:.2f}", f"latency.updates.{rank}.{k}") for k in ("median_ms", "p99_ms")]
        rows.append(Row([Cell(str(row["pedestrians"])), *cells]))
    text = (
        "Tracker, inputs, network and bookkeeping for all pedestrians at once, on one thread. "
        "The paper: 51 ms for 20 pedestrians on an i7-4810MQ."
    )
    table = Table(["pedestrians", "median [ms]", "99th percentile [ms]"], rows, texts=0)
    return [Section("Time per update", [Text(text), table], "latency")]
