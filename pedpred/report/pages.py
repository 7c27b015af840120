"""The pages: the answer first, then the numbers, what was expected of them, and the pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from pedpred.errors import ValueRuleError
from pedpred.report.findings import (
    below_in,
    in_the_noise,
    percent_better,
    real_findings,
    relative_gain,
    simulation_findings,
    summed_up,
)
from pedpred.report.measures import LEAKY, MethodMetrics, noncausal
from pedpred.report.methods import MODEL, PAPER_ADE_M, YARDSTICK, label
from pedpred.report.tables import calibration_table, findings_table, interval, methods_table, scenes_table

POOLED = "sim_test"
"""The scene under which all unseen simulated arrangements are pooled."""
READING = (
    "ADE: error averaged over the ten steps of 0.3 s; FDE: at 3 s; intervals: bootstrap over tracks; "
    "moving: faster than 0.3 m/s; points in obstacles: share of predicted points; paths that collide: share "
    "of windows whose predicted path comes closer than 0.2 m to another's. The paper's column is its own "
    "table, measured on its own windows."
)
IRREPRODUCIBLE = (
    f"The paper's own CV ({PAPER_ADE_M['real']['cv']} m) and CAcc ({PAPER_ADE_M['real']['ca']} m) on real "
    "data could not be reproduced from its text by any variant tried, so its column is not on the scale of "
    "ours: compare methods within a column, not across."
)
ELLIPSES = (
    "Some methods also tell how far off they may be, as a Gaussian of the position at every step. Its "
    "ellipses of 50, 90 and 95 % should hold as many of the true positions: if they hold fewer, the method "
    "is too sure of itself; if more, too careful. The negative log likelihood is smaller the smaller and "
    "righter the ellipses are. The networks learn theirs where they are trained; the Kalman filter's follow "
    "from its own noise."
)
LEAK = "These inputs contain up to 0.4 s of the future: the rows are no forecasts. ADE, m."
ALL_LEAKS = "**Leaky protocol: the inputs know the future, so nothing on this page is a forecast.**"


@dataclass(frozen=True)
class Picture:
    """A figure of a page.

    Attributes:
        name: file name without ending.
        caption: what is seen, and by which rule it was chosen.
        figure: the figure itself.
    """

    name: str
    caption: str
    figure: Figure


@dataclass(frozen=True)
class Section:
    """Pictures under one heading, `columns` side by side, with a text before them."""

    title: str
    pictures: Sequence[Picture]
    columns: int = 1
    text: str = ""


def simulation_page(scenes: Mapping[str, MethodMetrics], sections: Sequence[Section], folder: str) -> str:
    """Markdown page on simulated arrangements that no training saw.

    Args:
        scenes: metrics; the pooled scene and single arrangements beside it.
        sections: pictures.
        folder: where the pictures lie, relative to the page.
    """
    if POOLED not in scenes:
        raise ValueRuleError("scenes", sorted(scenes), f"the pooled scene '{POOLED}' must be among them")
    pooled = scenes[POOLED]
    single = {
        name.removeprefix(f"{POOLED}_"): methods
        for name, methods in scenes.items()
        if name != POOLED and not name.startswith(LEAKY)
    }
    findings = [("all arrangements", finding) for finding in simulation_findings(pooled)]
    parts = [
        "# Simulation: arrangements of obstacles that no training saw",
        *([ALL_LEAKS] if noncausal(scenes) else []),
        f"**{answer(pooled, 'In simulated arrangements that no training saw')}**",
        methods_table(pooled, PAPER_ADE_M["sim"]),
        READING,
        "## Expected and found",
        summed_up(findings),
        findings_table(findings),
        *_calibrated({"": pooled}),
    ]
    if single:
        wins = below_in(single, MODEL, ["lstm_nogrid", YARDSTICK])
        parts += ["## Single arrangements", f"ADE, m. {wins}", scenes_table(single, "arrangement")]
    return _page(parts + _leaky(scenes) + _shown(sections, folder))


def real_page(scenes: Mapping[str, MethodMetrics], sections: Sequence[Section], folder: str) -> str:
    """Markdown page on real locations, each tested by networks tuned at the other one."""
    honest = {name: methods for name, methods in scenes.items() if not name.startswith(LEAKY)}
    place = {name: tested_at(name, list(honest)) for name in honest}
    answers = [answer(methods, f"At {place[name]}") for name, methods in honest.items()]
    findings = [(name, f) for name, methods in honest.items() for f in real_findings(methods)]
    parts = ["# Real pedestrians: tested where no network was tuned"]
    parts += [*([ALL_LEAKS] if noncausal(scenes) else []), f"**{' '.join(answers)}**"]
    for name, methods in honest.items():
        parts += [f"Tested at {place[name]}:", methods_table(methods, PAPER_ADE_M["real"])]
    parts += [
        READING,
        IRREPRODUCIBLE,
        "## Expected and found",
        summed_up(findings),
        findings_table(findings),
        "## Directions",
        "ADE, m.",
        scenes_table({place[name]: methods for name, methods in honest.items()}, "tested at"),
        *_calibrated({f"Tested at {place[name]}:": methods for name, methods in honest.items()}),
    ]
    return _page(parts + _leaky(scenes) + _shown(sections, folder))


def answer(methods: MethodMetrics, where: str) -> str:
    """One sentence: how far off the model is, and whether that beats the yardstick."""
    if MODEL not in methods:
        return f"{where}, the {label(MODEL)} was not evaluated."
    found = methods[MODEL]
    text = (
        f"{where}, the {label(MODEL)} is off by {found['ade_m']:.3f} m on average over 3 s "
        f"(95 % interval {interval(found['ade_m_ci95'])} m; {found['windows']} windows of "
        f"{found['tracks']} tracks)"
    )
    if YARDSTICK not in methods:
        return text + f"; the {label(YARDSTICK)} was not evaluated."
    gain = percent_better(relative_gain(methods, MODEL, YARDSTICK))
    reference = f"the {label(YARDSTICK)}'s {methods[YARDSTICK]['ade_m']:.3f} m"
    if in_the_noise(found):
        return f"{text}, not distinguishable from {reference} ({gain}{_gap(found)})."
    return f"{text}, {gain} than {reference}{_gap(found, ' (', ')')}."


def tested_at(name: str, places: Sequence[str]) -> str:
    """A place, and where the networks were tuned if there is just one other."""
    others = [other for other in places if other != name]
    return f"{name} (tuned on {others[0]})" if len(others) == 1 else name


def _gap(found: dict, before: str = "; ", after: str = "") -> str:
    """The paired difference in words, if it was measured."""
    if found.get("ade_m_minus_reference") is None:
        return ""
    bounds = found.get("ade_m_minus_reference_ci95")
    spread = f", interval {interval(bounds, '+')} m" if bounds else ""
    return f"{before}difference {found['ade_m_minus_reference']:+.3f} m{spread}{after}"


def joined(pages: Sequence[str]) -> str:
    """One page of several: their headings move down by one level; links stay as they are."""
    lowered = ["\n".join(f"#{row}" if row.startswith("#") else row for row in p.split("\n")) for p in pages]
    return _page(["# Report", *(text.strip() for text in lowered)])


def _leaky(scenes: Mapping[str, MethodMetrics]) -> list[str]:
    """The rows of the protocol that lets the future in, labelled so."""
    leaky = {n.removeprefix(LEAKY): methods for n, methods in scenes.items() if n.startswith(LEAKY)}
    if not leaky:
        return []
    return ["## Leaky protocol (as in the paper)", LEAK, scenes_table(leaky, "tested at")]


def _calibrated(scenes: Mapping[str, MethodMetrics]) -> list[str]:
    """A table per title of what error ellipses hold; nothing where no method tells them."""
    tables = {title: calibration_table(methods) for title, methods in scenes.items()}
    found = [part for title, table in tables.items() if table for part in (title, table) if part]
    return ["## How far off a forecast may be", ELLIPSES, *found] if found else []


def _shown(sections: Sequence[Section], folder: str) -> list[str]:
    parts = []
    for section in sections:
        images = [f"![{p.name}]({folder}/{p.name}.png)" for p in section.pictures]
        captions = [picture.caption for picture in section.pictures]
        parts += [f"## {section.title}", *([section.text] if section.text else [])]
        if section.columns == 1:
            parts += [text for pair in zip(images, captions, strict=True) for text in pair]
        elif images:
            parts.append(_side_by_side(images, captions, section.columns))
    return parts


def _side_by_side(images: Sequence[str], captions: Sequence[str], columns: int) -> str:
    cells = [f"{image}<br>{caption}" for image, caption in zip(images, captions, strict=True)]
    cells += [""] * (-len(cells) % columns)
    rows = ["| " + " | ".join(cells[k : k + columns]) + " |" for k in range(0, len(cells), columns)]
    rule = "|" + " --- |" * columns
    return "\n".join(["|" + "  |" * columns, rule, *rows])


def _page(parts: Sequence[str]) -> str:
    return "\n\n".join(parts) + "\n"
