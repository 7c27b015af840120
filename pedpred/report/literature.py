"""ETH and UCY as most publications compare on them: our methods beside published figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pedpred.report.document import NOTHING, Block, Cell, Row, Section, Table, Text
from pedpred.report.measures import Figures, bounds_of
from pedpred.report.methods import Methods
from pedpred.report.tables import interval

Published = Mapping[str, Any]
"""A row of `report.published`: name, samples, errors_m (scene or mean -> [ADE, FDE]), remark."""

SCENES = ("eth", "hotel", "univ", "zara1", "zara2")
"""What is averaged, each with the same weight."""
MEAN = "mean"
_ONE, _BEST = ("ade_m", "fde_m"), ("best_ade_m", "best_fde_m")
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
    "from the forecast distribution so that they cover it (pedpred/literature/samples.py)."
)


def literature_section(
    literature: Mapping[str, Figures], published: Sequence[Published], methods: Methods
) -> list[Section]:
    """Tables of one forecast and of the best of 20; nothing without figures.

    Args:
        literature: scene, or scene_fold for stricter folds -> method -> figures.
        published: rows of others.
        methods: labels and order.
    """
    if not literature:
        return []
    tables = literature_tables(literature, published, methods)
    best = Section("Best of 20", [Text(_TWENTY), tables["literature_best"]])
    blocks: list[Block] = [Text(_SEEN), tables["literature_one"], best]
    if further := tables.get("literature_modes"):
        blocks.append(Section("Probabilities", [further]))
    return [Section("Beside the literature", blocks, "literature")]


def literature_tables(
    literature: Mapping[str, Figures], published: Sequence[Published], methods: Methods
) -> dict[str, Table]:
    """Tables by name: of one forecast, of the best of 20, and of modes where there are any."""
    header = ["errors in m", *(f"{scene} {word}" for scene in (MEAN, *SCENES) for word in ("ADE", "FDE"))]
    tables = {
        "literature_one": Table(header, _rows(literature, _ONE, methods) + _quoted(published, 1)),
        "literature_best": Table(header, _rows(literature, _BEST, methods) + _quoted(published, 20)),
    }
    if modes := _probabilities(literature, methods):
        tables["literature_modes"] = modes
    return tables


def strict_key(literature: Mapping[str, Figures], scene: str) -> str | None:
    """Entry of a scene whose whole street or campus was left out; None where there is none."""
    return next((key for key in literature if key.startswith(f"{scene}_")), None)


def _rows(literature: Mapping[str, Figures], keys: tuple[str, str], methods: Methods) -> list[Row]:
    """A row per method; a second one for networks under stricter folds, which differ at some scenes alone."""
    names = methods.ordered({name for figures in literature.values() for name in figures})
    rows = []
    for name in names:
        usual = {scene: scene for scene in SCENES}
        rows.append(_row(literature, name, methods[name].label, keys, usual))
        stricter = {scene: strict_key(literature, scene) or scene for scene in SCENES}
        if methods[name].learned and stricter != usual:
            label = f"{methods[name].label}, street or campus left out"
            rows.append(_row(literature, name, label, keys, stricter))
    return [row for row in rows if any(cell.text != NOTHING for cell in row.cells[1:])]


def _row(
    literature: Mapping[str, Figures],
    name: str,
    label: str,
    keys: tuple[str, str],
    entries: Mapping[str, str],
) -> Row:
    """Errors at all scenes, and their mean where there are all."""
    cells, errors = list[Cell](), list[list[float]]()
    for scene in SCENES:
        metrics = literature.get(entries[scene], {}).get(name, {})
        if not metrics.keys() >= set(keys):
            cells += [Cell(NOTHING)] * len(keys)
            continue
        errors.append([float(metrics[key]) for key in keys])
        for key, error in zip(keys, errors[-1], strict=True):
            bounds, place = bounds_of(metrics, key), f"literature.{entries[scene]}.{name}.{key}"
            cells.append(Cell(f"{error:.3f}", place, remark=f"95 % {interval(bounds)} m" if bounds else ""))
    means = np.mean(errors, axis=0) if len(errors) == len(SCENES) else ()
    first = [Cell(f"{mean:.3f}") for mean in means] or [Cell(NOTHING)] * len(keys)
    return Row([Cell(label), *first, *cells], name)


def _quoted(published: Sequence[Published], samples: int) -> list[Row]:
    """Rows of others with so many samples."""
    rows = []
    for row in published:
        if row["samples"] != samples:
            continue
        errors = dict(row["errors_m"])
        if set(SCENES) <= set(errors):
            errors[MEAN] = np.mean([errors[scene] for scene in SCENES], axis=0)
        pairs = [errors.get(key, (None, None)) for key in (MEAN, *SCENES)]
        cells = [Cell(NOTHING if error is None else f"{error:.2f}") for pair in pairs for error in pair]
        rows.append(Row([Cell(row["name"], remark=row.get("remark", "")), *cells]))
    return rows


def _probabilities(literature: Mapping[str, Figures], methods: Methods) -> Table | None:
    """Most likely path, best of 1, 3 and 6 modes, NLL, energy score and collisions of methods with modes."""
    keys = {
        "most_likely_ade_m": "ADE of the most likely path [m]", "min_ade_m_k3": "minADE3 [m]",
        "min_ade_m_k6": "minADE6 [m]", "nll": "NLL [nats]", "energy_score_m": "energy score [m]",
        "collision_share": "collisions [%]",
    }  # fmt: skip
    rows = []
    for scene in SCENES:
        for name, metrics in literature.get(scene, {}).items():
            if metrics.keys() >= keys.keys() | {"best_ade_m"}:
                scale = [100 if "share" in key else 1 for key in keys]
                cells = [Cell(f"{s * metrics[key]:.3g}") for s, key in zip(scale, keys, strict=True)]
                rows.append(Row([Cell(f"{methods[name].label}, {scene}"), *cells], name))
    return Table(["method, scene", *keys.values()], rows) if rows else None
