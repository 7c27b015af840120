"""Figures of drives in many episodes: `python -m benchmarks.driving TABLE.csv ... [--write]`.

Reads tables that `pedpred drive` has written, one per place, and makes three tables:

* `curves`: collisions at the robot's fault, and time to the goal, by method, limit of risk and place
  (`drives` in reports/benchmarks.md);
* `equal`: the network's modes beside the Kalman filter: collisions at the same time, and time beyond that of
  the true future at the same collisions, with 95 % intervals over episodes (docs/driving.md);
* `extremes`: if people are forecast to stand, and with the true future (reports/benchmarks.md).

Each table takes the episodes that all its methods have drives, so that some methods may drive more of them,
and the places where they have all drives.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tables import REPORT, show, write_tables
from pedpred.driving.figures import Episodes, share_interval
from pedpred.driving.forecasters import TRUTH
from pedpred.driving.table import Condition, Row, read_table
from pedpred.errors import InputError, user_errors
from pedpred.report.drives import LABELS

PAGE = Path("docs/driving.md")
_NETWORK, _SIMPLE, _WORST = "modes", "kalman", "standing"


def curve_rows(places: dict[str, Episodes]) -> Iterator[dict[str, Any]]:
    """A row per method and limit; per place: at fault, % (95 % interval); time, s."""
    conditions = dict.fromkeys(c for each in places.values() for c in each.conditions)
    for condition in conditions:
        row = {
            "at fault, % (95 % interval); s to the goal": LABELS.get(condition.method, condition.method),
            "limit": f"{condition.risk:g}" if condition.risk else "",
        }
        for name, each in places.items():
            cell = ""
            if condition in each.value["faults"]:
                fault, time_s = each.at_fault(condition), each.value["time_s"][condition]
                low, high = (100 * end for end in share_interval(fault))
                cell = f"{100 * fault.mean():.1f} ({low:.1f}-{high:.1f}); {time_s.mean():.1f}"
            row[f"{name} ({len(each.number)} episodes)"] = cell
        yield row


Curve = tuple[np.ndarray, np.ndarray]
"""Points of a method's limits, x and y, in the episodes and in replicates of them. [1 + S, L] each."""


def time_and_faults(each: Episodes, method: str) -> Curve:
    """Time to the goal, s, and share of episodes with a collision at fault, at each limit."""
    weight = np.concatenate([np.ones((1, each.draw.tracks)), each.draw.weight])
    weight /= weight.sum(axis=1, keepdims=True)
    limits = [c for c in each.conditions if c.method == method]
    time_s = weight @ np.array([each.value["time_s"][c] for c in limits]).T
    return time_s, weight @ np.array([each.at_fault(c) for c in limits]).T


def shared_middle(one: Curve, other: Curve) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Read two curves off in the middle of the range of x that they share.

    Returns:
        That x, and y of each curve, in each replicate [1 + S]; None if they share no x.
    """
    low = np.maximum(one[0].min(axis=1), other[0].min(axis=1))
    high = np.minimum(one[0].max(axis=1), other[0].max(axis=1))
    if low[0] > high[0]:
        return None
    middle = 0.5 * (low + high)
    read_off = []
    for x, y in (one, other):
        order = np.argsort(x, axis=1, kind="stable")
        rows = zip(middle, np.take_along_axis(x, order, 1), np.take_along_axis(y, order, 1), strict=True)
        read_off.append(np.array([np.interp(*row) for row in rows]))
    return middle, *read_off


def _ratio(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Quotients, infinite or NaN where the other is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        quotient: np.ndarray = one / other
    return quotient


def equal_rows(places: dict[str, Episodes]) -> Iterator[dict[str, Any]]:
    """A row per place: both methods in the middle of what their curves share, in time and in collisions."""
    for name, each in places.items():
        (time_a, fault_a), (time_b, fault_b) = (time_and_faults(each, m) for m in (_NETWORK, _SIMPLE))
        best_s = time_and_faults(each, TRUTH)[0][:, :1]
        by_time = shared_middle((time_a, fault_a), (time_b, fault_b))
        by_fault = shared_middle((fault_a, time_a - best_s), (fault_b, time_b - best_s))
        row: dict[str, Any] = {"place": name, "episodes": len(each.number)}
        titles = ("at, s", "network, %", "Kalman, %", "network / Kalman")
        row |= zip(titles, _cells(by_time, 1, 100), strict=True)
        if by_time is not None and not by_time[1][0]:  # replicates of no collisions are alike
            most = _ratio(np.array(share_interval(np.zeros(len(each.number)))[1]), by_time[2][0])
            row["network / Kalman"] = f"0.00 (0.00 to {most:.2f})"
        titles = ("at, %", "network, s more", "Kalman, s more", "network / Kalman, s")
        yield row | dict(zip(titles, _cells(by_fault, 100, 1), strict=True))


def _cells(middle: tuple[np.ndarray, ...] | None, x_scale: float, y_scale: float) -> list[str]:
    """Where two curves are compared, their values, and the ratio of these with its 95 % interval."""
    if middle is None:
        return ["-"] * 4
    at, a, b = middle
    ratio = _ratio(a, b)
    low, high = np.nanpercentile(ratio[1:], [2.5, 97.5], method="nearest")  # some may be infinite
    values = [f"{x_scale * at[0]:.1f}", f"{y_scale * a[0]:.1f}", f"{y_scale * b[0]:.1f}"]
    return [*values, f"{ratio[0]:.2f} ({low:.2f} to {high:.2f})"]


def extreme_rows(places: dict[str, Episodes]) -> Iterator[dict[str, Any]]:
    """A row per place: episodes with a collision at fault."""
    for name, each in places.items():
        row: dict[str, Any] = {"place": name}
        for method in (_WORST, TRUTH):
            fault = each.at_fault(Condition(method, 0.0))
            row[f"`{method}`"] = f"{round(fault.sum())} of {len(fault)}"
        yield row


def drives_in(tables: Sequence[Path]) -> dict[str, list[Row]]:
    """Place -> its drives.

    Raises:
        InputError: a table is damaged or has no drives, or two are of one place.
    """
    drives: dict[str, list[Row]] = {}
    for table in tables:
        if not (rows := read_table(table)):
            raise InputError(
                table, "", "no drives are in it", "Name a table that `pedpred drive` has written"
            )
        name = rows[0].place.replace("_", " ")
        if name in drives:
            raise InputError(
                table, "", f"its place, {name}, is that of an earlier table", "Name one for each place"
            )
        drives[name] = rows
    return drives


def tables_of(drives: Mapping[str, Sequence[Row]]) -> dict[str, list[dict[str, Any]]]:
    """Rows of all tables, by name."""

    def of(*methods: str) -> dict[str, Episodes]:
        return {
            name: Episodes.of([r for r in rows if r.condition.method in methods])
            for name, rows in drives.items()
            if {*methods} <= {r.condition.method for r in rows}
        }

    return {
        "curves": list(curve_rows({name: Episodes.of(rows) for name, rows in drives.items()})),
        "equal": list(equal_rows(of(_NETWORK, _SIMPLE, TRUTH))),
        "extremes": list(extreme_rows(of(_WORST, TRUTH))),
    }


@user_errors()
def main(arguments: list[str] | None = None) -> None:
    """Print the tables, and write them into the page if asked."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.driving",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("tables", type=Path, nargs="+", metavar="TABLE.csv")
    parser.add_argument("--write", action="store_true", help=f"write the tables into {PAGE} and {REPORT}")
    options = parser.parse_args(arguments)
    tables = tables_of(drives_in(options.tables))
    for name, rows in tables.items():
        show(name, rows)
    if options.write:
        write_tables(PAGE, {"equal": tables["equal"]})
        write_tables(REPORT, {"drives": tables["curves"], "extremes": tables["extremes"]})


if __name__ == "__main__":
    main()
