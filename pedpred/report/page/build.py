"""The page put together: what it says comes from here, how it looks from the template, style and scripts."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.colors import to_hex, to_rgb

from pedpred.report.canvas import avif_bytes
from pedpred.report.findings import Finding, real_findings, simulation_findings, summed_up
from pedpred.report.measures import LEAKY, MethodMetrics, noncausal
from pedpred.report.methods import LABELS, MODEL, PAPER_ADE_M, YARDSTICK, colours, label, ordered
from pedpred.report.page.charts import LinePlot, box_plot, line_plot, training_plots, whiskers
from pedpred.report.page.player import Replay
from pedpred.report.pages import (
    ALL_LEAKS,
    ELLIPSES,
    IRREPRODUCIBLE,
    LEAK,
    POOLED,
    READING,
    Section,
    answer,
    tested_at,
)
from pedpred.report.published import PUBLISHED
from pedpred.report.tables import calibration_cells, calibration_header, telling

_SCRIPTS = ("replay.js", "inputs.js", "player.js", "page.js")
_DRAWN_AS_PLOTS = ("horizon", "training")
"""Pictures of the galleries whose names begin so: the page draws these itself, sharp at any width."""


@dataclass(frozen=True)
class Answer:
    """A data set's part of the answer.

    Attributes:
        scene: its name in the metrics.
        title: what was tested, and where the networks had learned.
        sentence: the result in words.
        methods: the measures of each method.
        paper: which column of the paper's table stands beside it, `sim` or `real`.
    """

    scene: str
    title: str
    sentence: str
    methods: MethodMetrics
    paper: str


@dataclass(frozen=True)
class Contents:
    """What the page is made of.

    Attributes:
        simulated: metrics of simulated scenes, the pooled one among them; {scene: {method: measures}}.
        real: metrics of real scenes.
        sections: the galleries' pictures, by a title: simulated people, real people.
        curves: training curves by name.
        replays: stretches for the player, the first one is shown first.
        literature: figures under the protocol of the literature, {place: {method: measures}}.
        latency: the figures of `benchmarks.online`, one row per crowd, or nothing.
    """

    simulated: Mapping[str, MethodMetrics]
    real: Mapping[str, MethodMetrics]
    sections: Mapping[str, Sequence[Section]]
    curves: Mapping[str, pd.DataFrame]
    replays: Sequence[Replay]
    literature: Mapping[str, MethodMetrics] = field(default_factory=dict)
    latency: Sequence[Mapping[str, float]] = ()


def page(contents: Contents) -> str:
    """The whole page as HTML that needs nothing else; the same contents give the same text."""
    environment = Environment(
        loader=PackageLoader("pedpred.report", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"bold": _bold, "picture": _picture}
    environment.globals |= {"label": label, "ordered": ordered, "whiskers": whiskers}
    environment.globals |= {
        "telling": telling,
        "calibration_cells": calibration_cells,
        "calibration_header": calibration_header,
    }
    environment.globals |= {"model": MODEL, "yardstick": YARDSTICK}
    return environment.get_template("page.html").render(_values(contents))


def answers(simulated: Mapping[str, MethodMetrics], real: Mapping[str, MethodMetrics]) -> list[Answer]:
    """One answer per data set: all unseen simulated arrangements, then every real place."""
    honest = [name for name in real if not name.startswith(LEAKY)]
    pooled = simulated[POOLED]
    sentence = answer(pooled, "In simulated arrangements that no training saw")
    found = [Answer(POOLED, "Simulation, unseen arrangements", sentence, pooled, "sim")]
    for name in honest:
        place = tested_at(name, honest)
        sentence = answer(real[name], f"At {place}")
        found.append(Answer(name, f"Tested at {place}", sentence, real[name], "real"))
    return found


def _values(contents: Contents) -> dict[str, Any]:
    """Everything that the template names."""
    simulated, real = contents.simulated, contents.real
    shown = answers(simulated, real)
    names = ordered({name for a in shown for name in a.methods} | set(LABELS))
    findings = _findings(shown)
    leaky = {n: m for scenes in (simulated, real) for n, m in scenes.items() if n.startswith(LEAKY)}
    return {
        "answers": shown,
        "findings": findings,
        "verdict": summed_up(findings),
        "warning": ALL_LEAKS if noncausal(simulated) or noncausal(real) else "",
        "leaky": leaky,
        "leak": LEAK,
        "reading": READING,
        "irreproducible": IRREPRODUCIBLE,
        "ellipses": ELLIPSES,
        "calibrated": [a for a in shown if telling(a.methods)],
        "paper_ade_m": PAPER_ADE_M,
        "methods": _methods(names),
        "arrangements": _arrangements(simulated),
        "box_plots": [box_plot(a.methods, a.title) for a in shown],
        "training": training_plots(contents.curves),
        "literature": contents.literature,
        "published": PUBLISHED,
        "latency": contents.latency,
        "latency_plot": _latency_plot(contents.latency),
        "galleries": {title: _pictures(sections) for title, sections in contents.sections.items()},
        "replays": contents.replays,
        "style": Markup(_asset("page.css")),
        "script": Markup("\n".join(_asset(name) for name in _SCRIPTS)),
    }


def _methods(names: Sequence[str]) -> dict[str, dict[str, str]]:
    """What a reader sees of each method: its name, its colour on white, and a paler one on black."""
    shown = {}
    for name, colour in colours(names).items():
        red, green, blue = (0.75 * part + 0.25 for part in to_rgb(colour))
        shown[name] = {
            "label": label(name),
            "colour": colour,
            "colour_on_dark": to_hex((red, green, blue)),
        }
    return shown


def _findings(shown: Sequence[Answer]) -> list[tuple[str, Finding]]:
    judge = {"sim": simulation_findings, "real": real_findings}
    return [(a.scene, finding) for a in shown for finding in judge[a.paper](a.methods)]


def _arrangements(simulated: Mapping[str, MethodMetrics]) -> dict[str, MethodMetrics]:
    """The single simulated arrangements."""
    return {n: methods for n, methods in simulated.items() if n != POOLED and not n.startswith(LEAKY)}


def _pictures(sections: Sequence[Section]) -> list[Section]:
    """The galleries without what the page draws itself."""
    kept = []
    for section in sections:
        pictures = [p for p in section.pictures if not p.name.startswith(_DRAWN_AS_PLOTS)]
        if pictures:
            kept.append(Section(section.title, pictures, section.columns, section.text))
    return kept


def _latency_plot(rows: Sequence[Mapping[str, float]]) -> LinePlot | None:
    """Milliseconds per update over the size of the crowd."""
    if not rows:
        return None
    crowd, median = (np.array([row[key] for row in rows], float) for key in ("pedestrians", "median_ms"))
    return line_plot("One update", {MODEL: (crowd, median)}, "pedestrians", "time [ms]")


def _bold(text: str) -> Markup:
    """Escaped text in which `**words**` are strong."""
    return Markup(re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", str(escape(text))))


def _picture(figure: Any) -> str:
    """A figure as an address that holds the whole picture."""
    return "data:image/avif;base64," + base64.b64encode(avif_bytes(figure)).decode()


def _asset(name: str) -> str:
    return files(__package__).joinpath(name).read_text()
