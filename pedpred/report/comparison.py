"""Which metrics moved, and whether by more than their intervals allow.

A figure `x` is judged by the earlier 95 % interval `x_ci95` beside it: it moved when it lies outside. The
interval may be null, where no replicate had a value, as for a metric of one person in a small bootstrap.
"""

from __future__ import annotations

import subprocess
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pedpred.errors import InputError, PedpredError, ValueRuleError
from pedpred.files import read_json, translate_errors
from pedpred.metrics import METRICS
from pedpred.plain import parse_json
from pedpred.report.document import NOTHING, markdown_table
from pedpred.report.measures import bounds_of
from pedpred.report.tables import interval

_GAP = "_minus_reference"
Metrics = Mapping[str, Any]
"""Metric files by name: {file: {scene: {method: {"ade_m": ..., "ade_m_ci95": [low, high], ...}}}}."""


@dataclass(frozen=True)
class Figure:
    """One figure with its 95 % interval, None if it is null, and the number of windows behind it."""

    value: float
    bounds: tuple[float, float] | None
    windows: int


@dataclass(frozen=True)
class Change:
    """A figure before and after; None where it did not exist."""

    name: tuple[str, ...]  # (file, scene, method, figure)
    before: Figure | None  # at the revision
    after: Figure | None  # now

    @property
    def verdict(self) -> str:
        """`new`, `vanished`, `worse` or `better` beyond the earlier interval, `within` it, or `same`.

        What moved without an earlier interval is `unjudged`.
        """
        if self.before is None or self.after is None:
            return "new" if self.before is None else "vanished"
        if self.before.bounds is None:
            return "same" if self.after.value == self.before.value else "unjudged"
        low, high = self.before.bounds
        if not low <= self.after.value <= high:
            better = METRICS[self.name[-1].removesuffix(_GAP)].better
            return "better" if (self.after.value > high) == (better == "higher") else "worse"
        return "same" if self.after.value == self.before.value else "within"


def metrics_now(folder: Path) -> dict[str, Any]:
    """Read the metric files of a folder, by name.

    Raises:
        InputError: one of them is damaged.
    """
    return {
        path.stem: read_json(path, partial(InputError, path, "file", remedy="Write it again"))
        for path in sorted(folder.glob("*.json"))
    }


def metrics_at(revision: str, folder: Path) -> dict[str, Any]:
    """Read the metric files of a folder of a repository at a git revision, by name.

    Raises:
        InputError: there is no such folder, or it is in no repository.
        ValueRuleError: the revision is unknown.
        InputError: one of the files is damaged there.
    """
    lost = partial(InputError, folder, "", remedy="Name a folder of metrics in a git repository")
    if not folder.is_dir():
        raise lost("there is no such folder")
    _git(folder, lost, "rev-parse", "--git-dir")
    unknown = partial(ValueRuleError, "revision", revision)
    listed = _git(folder, unknown, "ls-tree", "--name-only", "-z", "--end-of-options", revision)
    metrics = {}
    for name in filter(lambda name: name.endswith(".json"), listed.split("\0")):
        remedy = "Compare with another revision"
        with translate_errors(partial(InputError, folder / name, revision, remedy=remedy)):
            text = _git(folder, unknown, "show", "--end-of-options", f"{revision}:./{name}")
            metrics[Path(name).stem] = parse_json(text)
    return metrics


def changes(before: Metrics, after: Metrics) -> list[Change]:
    """List every figure of either side, in the order of the files; those without an interval are left out."""
    old, new = dict(_figures(before)), dict(_figures(after))
    return [Change(name, old.get(name), new.get(name)) for name in [*new, *(old.keys() - new.keys())]]


def changes_table(changes: list[Change]) -> str:
    """Write what moved beyond its interval, appeared or vanished as a Markdown table, and count the rest.

    A new figure of a method that was there before is only counted: a new metric would fill pages.
    """
    counted = [change for change in changes if change.verdict not in ("same", "within")]
    known = {change.name[:3] for change in changes if change.before is not None}
    shown = [c for c in counted if c.verdict != "new" or c.name[:3] not in known]
    shown.sort(key=lambda change: ("worse", "vanished", "unjudged", "better", "new").index(change.verdict))
    rows = [[*c.name, _worded(c.before), _worded(c.after), c.verdict] for c in shown]
    header = ["file", "scene", "method", "figure", "before (95 % interval)", "now (95 % interval)", "verdict"]
    count = Counter(change.verdict for change in changes)
    unjudged = f", {count['unjudged']} moved without an interval" if count["unjudged"] else ""
    count_line = (
        f"{len(changes)} figures: {count['worse']} worse and {count['better']} better than their earlier "
        f"interval, {count['within']} moved within it, {count['same']} unchanged, "
        f"{count['new'] + count['vanished']} new or vanished{unjudged}."
    )
    return f"{markdown_table(header, rows, texts=7)}\n\n{count_line}" if rows else count_line


def _figures(node: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Figure]]:
    """Yield the judged figures of all entries, (file, scene, method) deep, by their full name."""
    if not isinstance(node, Mapping):
        return
    for key, value in node.items():
        if len(path) < 3:
            yield from _figures(value, (*path, key))
        elif key.removesuffix(_GAP) in METRICS and f"{key}_ci95" in node:
            yield (*path, key), Figure(value, bounds_of(node, key), node["windows"])


def _worded(figure: Figure | None) -> str:
    if figure is None:
        return NOTHING
    bounds = interval(figure.bounds) if figure.bounds else "no interval"
    return f"{figure.value:.3f} ({bounds}), {figure.windows} windows"


def _git(folder: Path, wording: Callable[[str], PedpredError], *arguments: str) -> str:
    """Run a git command in a folder; where it fails, what git says becomes an error."""
    call = ["git", "-C", str(folder), *arguments]
    done = subprocess.run(call, capture_output=True, text=True, check=False)  # noqa: S603, a list, no shell
    if done.returncode:
        raise wording(f"git says: {done.stderr.strip()}")
    return done.stdout
