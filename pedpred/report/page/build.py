"""The page: which sections it has. How they look follows from the templates, the style and the scripts."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.colors import to_hex, to_rgb

from pedpred.report.canvas import avif_bytes
from pedpred.report.document import Block, Pictures, Section, Text
from pedpred.report.findings import Paper
from pedpred.report.gather import Evaluated, title_of
from pedpred.report.methods import Methods
from pedpred.report.page.player import Replay
from pedpred.report.sections import (
    READING,
    answer_section,
    expectations_section,
    latency_section,
    paper_section,
    parts_sections,
    warnings,
)
from pedpred.report.tables import steps_table

_SCRIPTS = ("replay.js", "player.js", "page.js")
_IN_FIGURES = "The same in figures: mean (lower quartile, median, upper quartile), m"


@dataclass(frozen=True)
class Contents:
    """What the page is made of, in the order of the page."""

    evaluated: Sequence[Evaluated]  # by kind of test sets
    galleries: Sequence[Sequence[Section]]  # the pictures of each
    replays: Sequence[Replay]  # the first one is shown first
    methods: Methods
    paper: Paper
    avif_speed: int  # of the encoder of pictures, from 0, smallest files, to 10, fastest
    further: Sequence[Section] = ()  # of pictures beside those of the test sets
    latency: Sequence[Mapping[str, float]] = ()  # of `benchmarks.online`, one row per crowd
    places: Sequence[Block] = ()  # the real places side by side


def render_page(contents: Contents) -> str:
    """Write the whole page as HTML that needs nothing else; the same contents give the same text."""
    environment = Environment(
        loader=PackageLoader("pedpred.report", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"strong": _strong, "picture": partial(_picture, speed=contents.avif_speed)}
    result = next(result for study in contents.evaluated for result in study.results)
    steps = len(result.figures.over_steps("per_step_m"))
    return environment.get_template("page.html").render(
        sections=_sections(contents),
        replays=contents.replays,
        methods=_colours(contents.methods),
        labels={method.key: method.label for method in contents.methods},
        horizon_s=round(steps * result.dt_s, 2),
        style=Markup(_asset("page.css")),
        script=Markup("\n".join(_asset(name) for name in _SCRIPTS)),
    )


def _sections(contents: Contents) -> list[Section]:
    methods, paper = contents.methods, contents.paper
    results = [result for evaluated in contents.evaluated for result in evaluated.results]
    summary, table = expectations_section(results, methods, paper).blocks
    answer: list[Block] = [*warnings(results), *contents.places, summary]
    for result in results:
        section = answer_section(result, methods)
        if result.kind == "real":  # further metrics are in the Markdown report
            section = replace(section, blocks=section.blocks[:2], folded=True)
        answer.append(section)
    answer += [Text(READING, "note"), Section("Expectations", [table], folded=True)]
    answer += parts_sections(results, methods)
    titles = map(title_of, contents.evaluated)
    galleries = dict(zip(titles, contents.galleries, strict=True))
    unnamed = [Section(t, [s for s in pictures if not s.name]) for t, pictures in galleries.items()]
    return [
        Section("The answer", answer, "answer"),
        *paper_section(results, methods, paper),
        _horizons(contents),
        *_merged("calibration", galleries),
        *_merged("displacement", galleries),
        Section("Pictures", [*unnamed, *contents.further], "pictures"),
        *_merged("training", galleries),
        *latency_section(contents.latency),
    ]


def _horizons(contents: Contents) -> Section:
    """Errors over the horizon as pictures and as tables."""
    parts = []
    for evaluated, gallery in zip(contents.evaluated, contents.galleries, strict=True):
        pictures = [p for section in gallery if section.name == "horizon" for p in section.pictures]
        for result, picture in zip(evaluated.results, pictures, strict=True):
            table = Section(_IN_FIGURES, [steps_table(result, contents.methods)], folded=True)
            parts.append(Section(result.title, [Pictures([picture]), table]))
    return Section("Error over the horizon", parts, "horizon")


def _merged(name: str, galleries: Mapping[str, Sequence[Section]]) -> list[Section]:
    """The sections of a name in one; equal blocks appear once."""
    same = [section for sections in galleries.values() for section in sections if section.name == name]
    blocks = [block for section in same for block in section.blocks]
    once = [block for k, block in enumerate(blocks) if block not in blocks[:k]]
    return [Section(same[0].title, once, name)] if same else []


def _colours(methods: Methods) -> dict[str, dict[str, str]]:
    """Colour of each method, and a paler one for dark backgrounds."""
    shown = {}
    for row in methods:
        red, green, blue = (0.75 * part + 0.25 for part in to_rgb(row.colour))
        shown[row.key] = {"colour": row.colour, "colour_on_dark": to_hex((red, green, blue))}
    return shown


def _strong(text: str) -> Markup:
    """Escaped text in which `**words**` are strong."""
    return Markup(re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", str(escape(text))))


def _picture(figure: Any, speed: int) -> str:
    """A figure as an address that holds the whole picture."""
    return "data:image/avif;base64," + base64.b64encode(avif_bytes(figure, speed)).decode()


def _asset(name: str) -> str:
    return files(__package__).joinpath(name).read_text()
