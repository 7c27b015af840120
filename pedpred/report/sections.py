"""Sections that pages share: results in words and tables, expectations, calibration, comparisons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from pedpred.report.document import NOTHING, Block, Cell, Picture, Pictures, Row, Section, Table, Text
from pedpred.report.findings import Paper, better_than, in_the_noise, judge_expectations, sum_up
from pedpred.report.measures import Figures, Result
from pedpred.report.methods import Methods
from pedpred.report.tables import (
    calibration_table,
    findings_table,
    further_table,
    gap_cell,
    interval,
    metric_cell,
    metric_keys,
    metrics_table,
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
        blocks.append(
            Table(["place", "recording"], [Row([Cell(n), Cell(how)]) for n, how in missing.items()])
        )
    return blocks


def answer(result: Result, methods: Methods) -> str:
    """One sentence: the error of the main method, and whether it is below the reference's."""
    main, reference, start = methods.main, methods.reference, result.title
    if main.key not in result.figures:
        return f"{start}, the {main.label} was not evaluated."
    metrics = result.figures[main.key]
    horizon_s = len(metrics["per_step_m"]) * result.dt_s
    text = (
        f"{start}, the {main.label} has an ADE of {metrics['ade_m']:.3f} m over "
        f"{horizon_s:.0f} s (95 % interval {interval(metrics['ade_m_ci95'])} m; "
        f"{metrics['windows']} windows of {metrics['tracks']} tracks)"
    )
    if reference.key not in result.figures:
        return text + f"; the {reference.label} was not evaluated."
    other_m = result.figures[reference.key]["ade_m"]
    gain, than = better_than(metrics["ade_m"], other_m), f"the {reference.label}'s {other_m:.3f} m"
    gap = gap_cell(result.name, main.key, metrics, methods)
    words = "" if gap.text == NOTHING else f"difference {gap.text} m, interval {gap.bounds} m"
    if in_the_noise(metrics):
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
        wins = below_in(list(result.parts.values()), methods)
        sections.append(
            Section("Single scenes", [Text(f"ADE, m. {wins}"), scenes_table(result, methods)], folded=True)
        )
    return sections


def below_in(scenes: Sequence[Figures], methods: Methods) -> str:
    """In how many scenes the ADE of the main method, and of networks with ablations, is below others'."""
    main = methods.main
    pairs = [(main, other) for other in (methods.reference, *methods.networks) if other is not main]
    counts = []
    for one, other in [*pairs, *((whole, part) for part, whole in methods.ablations)]:
        both = [figures for figures in scenes if {one.key, other.key} <= figures.keys()]
        won = sum(figures[one.key]["ade_m"] < figures[other.key]["ade_m"] for figures in both)
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
    studies: dict[str, list[Result]] = {}
    for result in shown:
        studies.setdefault(result.study, []).append(result)
    header = ["ADE [m]"]
    for study, places in studies.items():
        header += [f"paper, {study}", *(f"here, {result.name}" for result in places)]
    rows = []
    for name in methods.ordered({name for result in shown for name in result.figures}):
        cells = [Cell(methods[name].label)]
        for study, places in studies.items():
            theirs = paper.ade_m[study].get(name)
            cells.append(Cell(NOTHING if theirs is None else f"{theirs:.3f}"))
            cells += [metric_cell(r.name, name, "ade_m", r.figures.get(name, {})) for r in places]
        rows.append(Row(cells, name, name == methods.main.key))
    remarks = [Text(paper.remarks[study], "note") for study in studies if study in paper.remarks]
    remarks.append(Text("The paper's figures were measured on its own windows.", "note"))
    return [Section("Beside the paper's table", [*remarks, Table(header, rows)], "paper")] if shown else []


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
