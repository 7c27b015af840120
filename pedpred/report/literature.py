"""ETH and UCY as most publications compare on them: our methods beside published figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd

from pedpred.errors import ConfigError
from pedpred.files import read_yaml, translate_errors
from pedpred.report.document import NOTHING, Block, Cell, Row, Section, Table, Text
from pedpred.report.methods import Methods
from pedpred.report.results import figure_of
from pedpred.report.tables import interval, pivot
from pedpred.settings import In, Range, Settings, load


@dataclass(frozen=True)
class Published(Settings):
    """Errors that others published under the protocol of `pedpred.evaluation.observed`.

    Attributes:
        name: of their method.
        samples: number of forecasts the best of which counts.
        errors_m: scene, or "mean" of all five -> (ADE, FDE).
        remark: how theirs was measured.
    """

    name: str
    samples: Annotated[int, In("[1, 1000]")]
    errors_m: Mapping[str, Annotated[Range, In("(0, 1000]")]]
    remark: str = ""


@dataclass(frozen=True)
class PublishedRows:
    """What others published."""

    published: Sequence[Published]


def read_published(folder: Path) -> Sequence[Published]:
    """Read the rows of others from a project's file.

    Raises:
        ConfigError: the file is missing or damaged, or a row breaks a rule.
    """
    wording = partial(ConfigError, "published", str(file := folder / "conf/report/published.yaml"))
    values = read_yaml(file, wording)
    with translate_errors(wording):
        return load(PublishedRows, values).published


SCENES = ("eth", "hotel", "univ", "zara1", "zara2")
"""What is averaged, each with the same weight."""
MEAN = "mean"
_PROBABILITIES = {
    "most_likely_ade_m": "ADE of the most likely path [m]",
    "min_ade_m_k3": "minADE3 [m]",
    "min_ade_m_k6": "minADE6 [m]",
    "nll": "NLL [nats]",
    "energy_score_m": "energy score [m]",
    "collision_share": "collisions [%]",
}
_SEEN = (
    "8 annotations 0.4 s apart are seen, the next 12 are forecast; one scene is left out at a time, and "
    "every person who is seen in all 20 annotations counts. Errors are in metres. Networks read "
    "positions, no map; figures are the mean of three trainings. The usual folds test Zara with other "
    "recordings of the same street in training; rows with the whole street or campus left out are stricter. "
    "The file of the scene eth is used as it is, though its frame rate is disputed."
)
_TWENTY = (
    "The error of the best of 20 forecasts, chosen with the truth. It rewards spread: read it beside the "
    "probabilities (NLL, energy score) and the most likely path. Those of this project are chosen "
    "from the forecast distribution so that they cover it (pedpred/metrics/covering.py)."
)


def literature_section(literature: pd.DataFrame, published: Sequence[Published], methods: Methods) -> Section:
    """Tables of one forecast and of the best of 20; without blocks where there are no figures.

    Args:
        literature: figures; a place is a scene, or scene_fold for stricter folds.
        published: rows of others.
        methods: labels and order.
    """
    if literature.empty:
        return Section("Beside the literature", [], "literature")
    tables = literature_tables(literature, published, methods)
    best = Section("Best of 20", [Text(_TWENTY), tables["literature_best"]])
    blocks: list[Block] = [Text(_SEEN), tables["literature_one"], best]
    if further := tables.get("literature_modes"):
        blocks.append(Section("Probabilities", [further]))
    return Section("Beside the literature", blocks, "literature")


def literature_tables(
    literature: pd.DataFrame, published: Sequence[Published], methods: Methods
) -> dict[str, Table]:
    """Tables by name: of one forecast, of the best of 20, and of modes where there are any."""
    header = ["errors in m", *(f"{scene} {word}" for scene in (MEAN, *SCENES) for word in ("ADE", "FDE"))]
    one, best = ("ade_m", "fde_m"), ("best_ade_m", "best_fde_m")
    tables = {
        "literature_one": Table(header, _ours(literature, one, methods) + _quoted(published, 1)),
        "literature_best": Table(header, _ours(literature, best, methods) + _quoted(published, 20)),
    }
    if rows := _probabilities(literature, methods):
        tables["literature_modes"] = Table(["method, scene", *_PROBABILITIES.values()], rows)
    return tables


def _ours(literature: pd.DataFrame, figures: tuple[str, str], methods: Methods) -> list[Row]:
    """A row per method; a second one for networks under stricter folds, which differ at some scenes alone."""
    places, rows = literature["place"].unique(), list[Row]()
    strict = [next((place for place in places if place.startswith(f"{s}_")), s) for s in SCENES]
    for name in methods.ordered(literature["method"]):
        own = literature[(literature["method"] == name) & literature["figure"].isin(figures)]
        own = own[own.groupby("place")["figure"].transform("size") == len(figures)]
        label, learned = methods[name].label, methods[name].learned
        rows.append(_row(own, figures, name, label, SCENES))
        if learned and strict != list(SCENES):
            rows.append(_row(own, figures, name, f"{label}, street or campus left out", strict))
    return [row for row in rows if any(cell.text != NOTHING for cell in row.cells[1:])]


def _row(own: pd.DataFrame, figures: Sequence[str], name: str, label: str, places: Sequence[str]) -> Row:
    """Errors of a method at the places that stand for the scenes, and their mean where there are all."""
    cells = pivot(own, ["place", "figure"], places, figures, _error_cell)
    errors = own.pivot(index="place", columns="figure", values="value").reindex(index=places, columns=figures)
    means = errors.to_numpy().mean(axis=0)
    first = [Cell(NOTHING if np.isnan(mean) else f"{mean:.3f}") for mean in means]
    return Row([Cell(label), *first, *(cell for pair in cells for cell in pair)], name)


def _error_cell(row: Any) -> Cell:
    value, bounds = figure_of(row)
    address = f"literature.{row.place}.{row.method}.{row.figure}"
    return Cell(f"{value:.3f}", address, remark=f"95 % {interval(bounds)} m" if bounds else "")


def _quoted(published: Sequence[Published], samples: int) -> list[Row]:
    """Rows of others with so many samples."""
    rows = []
    for row in (row for row in published if row.samples == samples):
        errors: dict[str, Any] = dict(row.errors_m)
        if set(SCENES) <= set(errors):
            errors[MEAN] = np.mean([errors[scene] for scene in SCENES], axis=0)
        pairs = [errors.get(key, (None, None)) for key in (MEAN, *SCENES)]
        cells = [Cell(NOTHING if error is None else f"{error:.2f}") for pair in pairs for error in pair]
        rows.append(Row([Cell(row.name, remark=row.remark), *cells]))
    return rows


def _probabilities(literature: pd.DataFrame, methods: Methods) -> list[Row]:
    """Most likely path, best of 1, 3 and 6 modes, NLL, energy score and collisions of methods with modes."""
    whole = literature[(literature["step"] == 0) & literature["place"].isin(SCENES)]
    values = whole.pivot(index=["place", "method"], columns="figure", values="value")
    complete = values.reindex(columns=[*_PROBABILITIES, "best_ade_m"]).dropna()
    rows, pairs = [], whole[["place", "method"]].drop_duplicates()
    pairs = pairs.sort_values("place", key=lambda places: places.map(SCENES.index), kind="stable")
    for scene, name in pairs.itertuples(index=False, name=None):
        if (scene, name) in complete.index:
            figures = complete.loc[(scene, name)]
            shown = [figures[key] * (100 if "share" in key else 1) for key in _PROBABILITIES]
            label = f"{methods[name].label}, {scene}"
            rows.append(Row([Cell(label), *(Cell(f"{value:.3g}") for value in shown)], name))
    return rows
