"""The table of drives: one row per episode and condition, read and written as CSV, and its summary."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pedpred.driving.forecasters import NAMES
from pedpred.driving.measures import Measures
from pedpred.errors import StorageError
from pedpred.evaluation.summary import TrackBootstrap
from pedpred.files import read_lines, write_text

_DIGITS = 4
_MEASURES = [field.name for field in fields(Measures)]
_WHOLE = [field.name for field in fields(Measures) if field.type == "int"]
_KEYS = ["place", "robot", "method", "risk", "episode", "settings"]


class Condition(NamedTuple):
    """What drives: a forecaster, and the limit of risk of the planner."""

    method: str
    risk: float


@dataclass(frozen=True)
class Row:
    """One drive.

    Attributes:
        place: name of the scene.
        robot: kind.
        condition: method and limit of risk.
        episode: number.
        settings: checksum of everything else that the drive depends on.
        measures: of the drive.
    """

    place: str
    robot: str
    condition: Condition
    episode: int
    settings: str
    measures: Measures

    @property
    def order(self) -> tuple[Any, ...]:
        """Rows are written in this order."""
        return NAMES.index(self.condition.method), self.condition.risk, self.episode

    def values(self) -> dict[str, Any]:
        """Columns of the table."""
        figures = {
            name: value if isinstance(value, int) else round(float(value), _DIGITS)
            for name, value in asdict(self.measures).items()
        }
        method, risk = self.condition
        keys = (self.place, self.robot, method, risk, self.episode, self.settings)
        return dict(zip(_KEYS, keys, strict=True)) | figures


def read_table(path: Path) -> list[Row]:
    """Read a table of `write_table`.

    Raises:
        StorageError: a line is no row of such a table.
    """
    lines = csv.DictReader(line for _, line in read_lines(path))
    rows = []
    for number, given in enumerate(lines, 2):
        try:
            condition = Condition(given["method"], float(given["risk"]))
            NAMES.index(condition.method)
            figures: dict[str, Any] = {
                name: (int if name in _WHOLE else float)(given[name]) for name in _MEASURES
            }
            keys = given["place"], given["robot"], condition, int(given["episode"]), given["settings"]
            rows.append(Row(*keys, Measures(**figures)))
        except (KeyError, ValueError, TypeError) as cause:
            problem = f"line {number} is no row of a table of drives ({cause})"
            raise StorageError(path, "table", problem, "Name another table, or remove this one") from cause
    return rows


def write_table(path: Path, rows: Iterable[Row]) -> None:
    """Write a table, by method, limit of risk and episode; the same rows give the same bytes."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [*_KEYS, *_MEASURES], lineterminator="\n")
    writer.writeheader()
    writer.writerows(row.values() for row in sorted(rows, key=lambda row: row.order))
    write_text(path, text.getvalue())


class Episodes(NamedTuple):
    """Measures of all conditions in the same episodes, and a bootstrap over these.

    Attributes:
        value: measure -> condition -> one per episode. [E]
        draw: of episodes.
    """

    value: dict[str, dict[Condition, np.ndarray]]
    draw: TrackBootstrap

    @classmethod
    def of(cls, rows: Sequence[Row], samples: int = 1000, seed: int = 0) -> Episodes:
        """Arrange the episodes that all conditions have driven."""
        found: dict[Condition, dict[int, Measures]] = {}
        for row in sorted(rows, key=lambda row: row.order):
            found.setdefault(row.condition, {})[row.episode] = row.measures
        common = sorted(set.intersection(*(set(own) for own in found.values()))) if found else []
        value = {
            name: {c: np.array([getattr(own[e], name) for e in common], float) for c, own in found.items()}
            for name in _MEASURES
        }
        rng = np.random.default_rng(seed)
        return cls(value, TrackBootstrap.draw(np.arange(len(common)), samples, rng))

    @property
    def conditions(self) -> list[Condition]:
        """In the order of the table."""
        return list(self.value["faults"])

    def at_fault(self, condition: Condition) -> np.ndarray:
        """Which episodes have a collision at the robot's fault, as 0 or 1. [E]."""
        return (self.value["faults"][condition] > 0).astype(float)


def summary(rows: Sequence[Row]) -> str:
    """Write figures of each condition as text; intervals are of 95 %, over episodes."""
    each = Episodes.of(rows)
    titles: tuple[str, ...] = (
        "method",
        "risk",
        "at fault %",
        "95 % interval",
        "collisions %",
        "success %",
        "reached %",
    )
    titles += ("time s", "ratio", "path", "stopped s", "intrusion s", "jerk")
    cells: list[Sequence[str]] = [titles]
    for condition in each.conditions:
        own = {name: values[condition] for name, values in each.value.items()}
        fault = each.at_fault(condition)
        low, high = each.draw.interval(fault)
        path = own["path_ratio"][np.isfinite(own["path_ratio"])]
        shares = [fault.mean(), (own["contacts"] > 0).mean(), own["success"].mean(), own["reached"].mean()]
        percents = [f"{100 * share:.1f}" for share in shares]
        means = [own[name].mean() for name in ("stopped_s", "intrusion_s", "jerk_mps3")]
        cells.append(
            (
                condition.method, f"{condition.risk:g}", percents[0], f"{100 * low:.1f} - {100 * high:.1f}",
                *percents[1:], f"{own['time_s'].mean():.2f}", f"{own['time_ratio'].mean():.2f}",
                f"{path.mean() if len(path) else np.nan:.2f}", *(f"{mean:.2f}" for mean in means),
            )
        )  # fmt: skip
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  ".join(cell.rjust(w) for cell, w in zip(line, widths, strict=True)) for line in cells]
    about = f"{rows[0].place}, {rows[0].robot}: {each.draw.tracks} episodes, the same ones for each row"
    return "\n".join([about, *lines, ""])


def equal_time(each: Episodes, one: str, other: str) -> tuple[float, float, float, float] | None:
    """Compare collisions at the robot's fault of two methods at the same mean time to the goal.

    Each method's limits of risk give a curve: share of episodes with such a collision, over the mean time.
    The curves are compared in the middle of the times that both have.

    Args:
        each: the episodes.
        one: method.
        other: method.

    Returns:
        That time, s; the share of `one` minus that of `other`, and its 95 % interval over episodes. None if
        the curves have no time in common.
    """
    curves = [[c for c in each.conditions if c.method == name] for name in (one, other)]
    weight = np.concatenate([np.ones((1, each.draw.tracks)), each.draw.weight])
    weight = weight / weight.sum(axis=1, keepdims=True)
    times = [weight @ np.array([each.value["time_s"][c] for c in own]).T for own in curves if own]
    if len(times) < 2 or any(own.shape[1] < 2 for own in times):
        return None
    low, high = max(own[0].min() for own in times), min(own[0].max() for own in times)
    if low > high:
        return None
    middle = 0.5 * (low + high)
    shares = []
    for own, time_s in zip(curves, times, strict=True):
        fault = weight @ np.array([each.at_fault(c) for c in own]).T
        order = np.argsort(time_s, axis=1)
        rows = zip(np.take_along_axis(time_s, order, 1), np.take_along_axis(fault, order, 1), strict=True)
        shares.append(np.array([np.interp(middle, *pair) for pair in rows]))
    apart = shares[0] - shares[1]
    ends = np.percentile(apart[1:], [2.5, 97.5])
    return float(middle), float(apart[0]), float(ends[0]), float(ends[1])
