"""Figures of drives: shares and means with intervals, and methods compared at the same time to the goal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from pedpred.driving.measures import Measures
from pedpred.driving.table import MEASURES, Condition, Row
from pedpred.evaluation.summary import TrackBootstrap

_DIGITS = 4


class Episodes(NamedTuple):
    """Measures of all conditions in the same episodes, and a bootstrap over these.

    Attributes:
        number: of the episodes, rising. [E]
        value: measure -> condition -> one per episode. [E]
        draw: of episodes.
    """

    number: np.ndarray
    value: dict[str, dict[Condition, np.ndarray]]
    draw: TrackBootstrap

    @classmethod
    def of(cls, rows: Sequence[Row], samples: int = 1000, seed: int = 0) -> Episodes:
        """Arrange the episodes that all conditions have driven."""
        measured: dict[Condition, dict[int, Measures]] = {}
        for row in sorted(rows, key=lambda row: row.order):
            measured.setdefault(row.condition, {})[row.episode] = row.measures
        common = (
            sorted(set.intersection(*(set(measures) for measures in measured.values()))) if measured else []
        )
        value = {
            name: {
                c: np.array([getattr(measures[e], name) for e in common], float)
                for c, measures in measured.items()
            }
            for name in MEASURES
        }
        rng = np.random.default_rng(seed)
        return cls(np.array(common), value, TrackBootstrap.draw(np.arange(len(common)), samples, rng))

    @property
    def conditions(self) -> list[Condition]:
        """In the order of the table."""
        return list(self.value["faults"])

    def at_fault(self, condition: Condition) -> np.ndarray:
        """Which episodes have a collision at the robot's fault, as 0 or 1. [E]."""
        return (self.value["faults"][condition] > 0).astype(float)


def share_interval(happened: np.ndarray) -> tuple[float, float]:
    """Find the 95 % interval of a share by Wilson's score, which also says how much no case of few can mean.

    A bootstrap of cases without a single collision would say that there is never one.

    Args:
        happened: 0 or 1 for each case. [E]
    """
    cases = len(happened)
    if not cases:
        return float("nan"), float("nan")
    share, squared = float(np.mean(happened)), _DEVIATIONS**2 / cases
    middle = (share + squared / 2) / (1 + squared)
    half = _DEVIATIONS * ((share * (1 - share) + squared / 4) / cases) ** 0.5 / (1 + squared)
    return max(middle - half, 0.0), min(middle + half, 1.0)


_DEVIATIONS = 1.959964
"""Of a normal distribution, between which 95 % of it lie."""


def figures_of(rows: Sequence[Row]) -> dict[str, Any]:
    """Summarise a table as plain values; intervals are of 95 %, over episodes.

    Returns:
        `place`, `robot`, `episodes`; `methods`: method -> limit of risk -> figures; `equal_time`: see
        `equal_time`, of `modes` minus each other method with a curve.
    """
    each = Episodes.of(rows)
    methods: dict[str, dict[str, dict[str, Any]]] = {}
    for condition in each.conditions:
        methods.setdefault(condition.method, {})[f"{condition.risk:g}"] = _condition_figures(each, condition)
    about: dict[str, Any] = {"place": rows[0].place, "robot": rows[0].robot, "episodes": each.draw.tracks}
    others = [name for name, limits in methods.items() if name != _MAIN and len(limits) > 1]
    compared = {
        name: comparison for name in others if (comparison := equal_time(each, _MAIN, name)) is not None
    }
    return about | {"methods": methods, "equal_time": compared}


_MAIN = "modes"


def _condition_figures(each: Episodes, condition: Condition) -> dict[str, Any]:
    measures = {name: values[condition] for name, values in each.value.items()}
    fault, path = each.at_fault(condition), measures["path_ratio"]
    shares = {
        "at_fault": fault,
        "collisions": (measures["contacts"] > 0).astype(float),
        "success": measures["success"],
        "reached": measures["reached"],
    }
    figures: dict[str, Any] = {}
    intervals = {name: share_interval(values) for name, values in shares.items()}
    intervals["time_s"] = each.draw.interval(measures["time_s"])
    for name, ends in intervals.items():
        figures[name] = round(float((shares | measures)[name].mean()), _DIGITS)
        figures[f"{name}_ci95"] = [round(float(end), _DIGITS) for end in ends]
    means = {name: measures[name] for name in _MEANS} | {"path_ratio": path[np.isfinite(path)]}
    for name, values in means.items():
        figures[name] = round(float(values.mean()), _DIGITS) if len(values) else None
    return figures


_MEANS = ("time_ratio", "stopped_s", "intrusion_s", "jerk_mps3", "wall_contacts")
_COLUMNS = {
    "collisions %": ("collisions", 100.0, ".1f"), "success %": ("success", 100.0, ".1f"),
    "reached %": ("reached", 100.0, ".1f"), "time s": ("time_s", 1.0, ".2f"),
    "ratio": ("time_ratio", 1.0, ".2f"), "path": ("path_ratio", 1.0, ".2f"),
    "stopped s": ("stopped_s", 1.0, ".2f"), "intrusion s": ("intrusion_s", 1.0, ".2f"),
    "jerk": ("jerk_mps3", 1.0, ".2f"),
}  # fmt: skip


def summary(figures: Mapping[str, Any]) -> str:
    """Write `figures_of` a table as text."""
    cells = [["method", "risk", "at fault %", "95 % interval", *_COLUMNS]]
    for method, limits in figures["methods"].items():
        for risk, measures in limits.items():
            low, high = measures["at_fault_ci95"]
            line = [method, risk, f"{100 * measures['at_fault']:.1f}", f"{100 * low:.1f} - {100 * high:.1f}"]
            for name, scale, form in _COLUMNS.values():
                line.append("-" if measures[name] is None else format(scale * measures[name], form))
            cells.append(line)
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  ".join(cell.rjust(w) for cell, w in zip(line, widths, strict=True)) for line in cells]
    about = (
        f"{figures['place']}, {figures['robot']}: {figures['episodes']} episodes, the same ones for each row"
    )
    return "\n".join([about, *lines, *map(_compared, figures["equal_time"].items()), ""])


def _compared(entry: tuple[str, Mapping[str, Any]]) -> str:
    """A line that compares modes with another method at equal time."""
    name, comparison = entry
    low, high = (100 * end for end in comparison["at_fault_ci95"])
    difference = 100 * comparison["at_fault"]
    return (
        f"{_MAIN} minus {name}, at {comparison['time_s']:.2f} s to the goal: {difference:+.1f} % of "
        f"the episodes with a collision at fault (95 % interval {low:+.1f} to {high:+.1f})"
    )


def equal_time(each: Episodes, one: str, other: str) -> dict[str, Any] | None:
    """Compare collisions at the robot's fault of two methods at the same mean time to the goal.

    Each method's limits of risk give a curve: share of episodes with such a collision, over the mean time.
    The curves are compared in the middle of the times that both have.

    Args:
        each: the episodes.
        one: method.
        other: method.

    Returns:
        `time_s`: that time; `at_fault`: the share of `one` minus that of `other`; `at_fault_ci95`: its
        interval over episodes. None if the curves have no time in common.
    """
    curves = [[c for c in each.conditions if c.method == name] for name in (one, other)]
    weight = np.concatenate([np.ones((1, each.draw.tracks)), each.draw.weight])
    weight = weight / weight.sum(axis=1, keepdims=True)
    times = [weight @ np.array([each.value["time_s"][c] for c in curve]).T for curve in curves if curve]
    if len(times) < 2 or any(curve.shape[1] < 2 for curve in times):
        return None
    low, high = max(curve[0].min() for curve in times), min(curve[0].max() for curve in times)
    if low > high:
        return None
    middle = 0.5 * (low + high)
    shares = []
    for curve, time_s in zip(curves, times, strict=True):
        fault = weight @ np.array([each.at_fault(c) for c in curve]).T
        order = np.argsort(time_s, axis=1)
        rows = zip(np.take_along_axis(time_s, order, 1), np.take_along_axis(fault, order, 1), strict=True)
        shares.append(np.array([np.interp(middle, *pair) for pair in rows]))
    apart = shares[0] - shares[1]
    ends = np.percentile(apart[1:], [2.5, 97.5])
    if not any(each.at_fault(c).any() for curve in curves for c in curve):  # replicates of nothing are alike
        most = share_interval(np.zeros(each.draw.tracks))[1]
        ends = np.array([-most, most])
    result = {"time_s": middle, "at_fault": apart[0]}
    bounds = [round(float(end), _DIGITS) for end in ends]
    return {name: round(float(value), _DIGITS) for name, value in result.items()} | {"at_fault_ci95": bounds}
