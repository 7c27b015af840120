"""Figures of drives in many episodes: `python -m benchmarks.driving TABLE.csv ... [--write]`.

Reads tables that `pedpred drive` has written, one per place, and makes three tables of docs/driving.md:

* `curves`: collisions at the robot's fault, and time to the goal, by method, limit of risk and place;
* `equal`: the network's modes beside the Kalman filter: collisions at the same time, and time beyond that of
  the true future at the same collisions, with 95 % intervals over episodes;
* `extremes`: if people are forecast to stand, and with the true future.

Each table takes the episodes that all its methods have drives, so that some methods may drive more of them,
and the places where they have all drives.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tables import show, write_tables
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


class Curves:
    """Collisions over time of some methods, in the episodes and in replicates of them.

    Attributes:
        weight: of the episodes, first all alike, then those of the replicates. [1 + S, E]
    """

    def __init__(self, each: Episodes):
        weight = np.concatenate([np.ones((1, each.draw.tracks)), each.draw.weight])
        self._each, self.weight = each, weight / weight.sum(axis=1, keepdims=True)

    def points(self, method: str) -> tuple[np.ndarray, np.ndarray]:
        """Time to the goal, s, and share of collisions at fault at each limit. [1 + S, L] each."""
        curve = [c for c in self._each.conditions if c.method == method]
        time_s = self.weight @ np.array([self._each.value["time_s"][c] for c in curve]).T
        return time_s, self.weight @ np.array([self._each.at_fault(c) for c in curve]).T


def _read_off(at: np.ndarray, xs: np.ndarray, ys: np.ndarray) -> np.ndarray:
    """Values of curves through points (x, y) at given x, in each replicate. [1 + S]."""
    order = np.argsort(xs, axis=1, kind="stable")
    rows = zip(at, np.take_along_axis(xs, order, 1), np.take_along_axis(ys, order, 1), strict=True)
    return np.array([np.interp(*row) for row in rows])


def _middle(one: np.ndarray, other: np.ndarray) -> np.ndarray | None:
    """Middle of what two curves have in common, in each replicate [1 + S]; None if it is nothing."""
    low = np.maximum(one.min(axis=1), other.min(axis=1))
    high = np.minimum(one.max(axis=1), other.max(axis=1))
    return None if low[0] > high[0] else 0.5 * (low + high)


def _ratio(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Quotients, infinite or not a number where the other is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        quotient: np.ndarray = one / other
    return quotient


def _with_interval(values: np.ndarray, form: str) -> str:
    low, high = np.nanpercentile(values[1:], [2.5, 97.5], method="nearest")  # there may be infinite ones
    return f"{values[0]:{form}} ({low:{form}} to {high:{form}})"


def equal_rows(places: dict[str, Episodes]) -> Iterator[dict[str, Any]]:
    """A row per place: both methods in the middle of what their curves share, in time and in collisions."""
    for name, each in places.items():
        curves = Curves(each)
        (time_a, fault_a), (time_b, fault_b) = curves.points(_NETWORK), curves.points(_SIMPLE)
        best_s = curves.points(TRUTH)[0][:, 0]
        row: dict[str, Any] = {"place": name, "episodes": len(each.number)}
        at_s = _middle(time_a, time_b)
        if at_s is None:
            row |= dict.fromkeys(("at, s", "network, %", "Kalman, %", "network / Kalman"), "-")
        else:
            a, b = _read_off(at_s, time_a, fault_a), _read_off(at_s, time_b, fault_b)
            row |= {
                "at, s": f"{at_s[0]:.1f}",
                "network, %": f"{100 * a[0]:.1f}",
                "Kalman, %": f"{100 * b[0]:.1f}",
            }
            row["network / Kalman"] = _with_interval(_ratio(a, b), ".2f")
            if not a[0]:  # replicates of nothing are alike
                most = _ratio(np.array(share_interval(np.zeros(len(each.number)))[1]), b[0])
                row["network / Kalman"] = f"0.00 (0.00 to {most:.2f})"
        at = _middle(fault_a, fault_b)
        if at is None:
            row |= dict.fromkeys(("at, %", "network, s more", "Kalman, s more", "network / Kalman, s"), "-")
        else:
            a, b = (_read_off(at, f, t) - best_s for f, t in ((fault_a, time_a), (fault_b, time_b)))
            row |= {
                "at, %": f"{100 * at[0]:.1f}",
                "network, s more": f"{a[0]:.1f}",
                "Kalman, s more": f"{b[0]:.1f}",
            }
            row["network / Kalman, s"] = _with_interval(_ratio(a, b), ".2f")
        yield row


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
    parser.add_argument("--write", action="store_true", help=f"write the tables into {PAGE}")
    options = parser.parse_args(arguments)
    tables = tables_of(drives_in(options.tables))
    for name, rows in tables.items():
        show(name, rows)
    if options.write:
        write_tables(PAGE, tables)


if __name__ == "__main__":
    main()
