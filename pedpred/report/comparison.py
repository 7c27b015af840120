"""Which figures of the metric files moved, and whether by more than their intervals allow.

A figure `x_m` is judged by the earlier 95 % interval `x_ci95_m` beside it: it moved when it lies outside.
`fde_m` may have none of its own; it is then given the relative width of the ADE's, since both are
errors of the same paths. Every judged figure is an error in metres: less is better.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pedpred.errors import StorageError, ValueRuleError
from pedpred.files import read_json, translate_errors
from pedpred.report.methods import NOTHING
from pedpred.report.tables import interval, markdown_table

JUDGED = ("ade_m", "fde_m", "minus_kalman_cv_m")
"""What is compared: mean error, error at the last step, paired difference to the strongest simple method."""

Metrics = Mapping[str, Any]
"""Metric files by name: {file: {scene: {method: {"ade_m": ..., "ade_ci95_m": [low, high], ...}}}}."""


@dataclass(frozen=True)
class Figure:
    """One figure, m, with its 95 % interval, over so many windows."""

    value_m: float
    bounds_m: tuple[float, float]
    windows: int


@dataclass(frozen=True)
class Change:
    """A figure before and after; None where it did not exist.

    Attributes:
        name: (file, scene, method, figure).
        before: at the revision.
        after: now.
    """

    name: tuple[str, ...]
    before: Figure | None
    after: Figure | None

    @property
    def verdict(self) -> str:
        """`new`, `vanished`, `worse` or `better` beyond the earlier interval, `within` it, or `same`."""
        if self.before is None or self.after is None:
            return "new" if self.before is None else "vanished"
        low, high = self.before.bounds_m
        if self.after.value_m > high:
            return "worse"
        if self.after.value_m < low:
            return "better"
        return "same" if self.after.value_m == self.before.value_m else "within"


def metrics_now(folder: Path) -> dict[str, Any]:
    """The metric files of a folder, by name.

    Raises:
        StorageError: one of them is damaged.
    """
    return {
        path.stem: read_json(path, partial(StorageError, path, "file", remedy="Write it again (dvc repro)"))
        for path in sorted(folder.glob("*.json"))
    }


def metrics_at(revision: str, folder: Path) -> dict[str, Any]:
    """The metric files that a git revision holds of a folder of a repository, by name.

    Raises:
        ValueRuleError: the revision is unknown.
        StorageError: one of the files is damaged there.
    """
    found = {}
    for name in filter(lambda name: name.endswith(".json"), _said("ls-tree", folder, revision).splitlines()):
        address = f"{revision}:./{name}"
        with translate_errors(
            partial(StorageError, folder / name, revision, remedy="Compare with another revision")
        ):
            found[Path(name).stem] = json.loads(_said("show", folder, address))
    return found


def changes(before: Metrics, after: Metrics) -> list[Change]:
    """Every figure of either side, in the order of the files; figures without an interval are not judged."""
    old, new = dict(_figures(before)), dict(_figures(after))
    return [Change(name, old.get(name), new.get(name)) for name in [*new, *(old.keys() - new.keys())]]


def changes_table(found: list[Change]) -> str:
    """A Markdown table of what moved beyond its interval, appeared or vanished, and a count of the rest."""
    shown = [change for change in found if change.verdict not in ("same", "within")]
    rows = [[*c.name, _worded(c.before), _worded(c.after), c.verdict] for c in sorted(shown, key=_rank)]
    header = ["file", "scene", "method", "figure", "before (95 % interval)", "now (95 % interval)", "verdict"]
    count = {v: sum(c.verdict == v for c in found) for v in ("worse", "better", "within", "same")}
    told = (
        f"{len(found)} figures: {count['worse']} worse and {count['better']} better than their earlier "
        f"interval, {count['within']} moved within it, {count['same']} unchanged, "
        f"{len(shown) - count['worse'] - count['better']} new or vanished."
    )
    return f"{markdown_table(header, rows, texts=7)}\n\n{told}" if rows else told


def _figures(node: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Figure]]:
    """The judged figures of all entries, (file, scene, method) deep, by their full name."""
    if not isinstance(node, Mapping):
        return
    for key, value in node.items():
        if len(path) < 3:
            yield from _figures(value, (*path, key))
        elif key in JUDGED and (bounds := _bounds(node, key)):
            yield (*path, key), Figure(value, bounds, node["windows"])


def _bounds(entry: Mapping[str, Any], key: str) -> tuple[float, float] | None:
    """The interval of a figure of an entry, m."""
    own = entry.get(f"{key.removesuffix('_m')}_ci95_m")
    if own is None and key == "fde_m" and entry.get("ade_m"):
        own = [entry[key] * end / entry["ade_m"] for end in entry["ade_ci95_m"]]
    return (own[0], own[1]) if own else None


def _worded(figure: Figure | None) -> str:
    if figure is None:
        return NOTHING
    return f"{figure.value_m:.3f} ({interval(figure.bounds_m)}), {figure.windows} windows"


def _rank(change: Change) -> int:
    return ("worse", "vanished", "better", "new").index(change.verdict)


def _said(command: str, folder: Path, revision: str) -> str:
    """What git says about a revision, seen from a folder."""
    options = ["--name-only"] if command == "ls-tree" else []
    call = ["git", "-C", str(folder), command, *options, "--end-of-options", revision]
    done = subprocess.run(call, capture_output=True, text=True, check=False)  # noqa: S603, a list, no shell
    if done.returncode:
        raise ValueRuleError("revision", revision, f"git must find metrics there: {done.stderr.strip()}")
    return done.stdout
