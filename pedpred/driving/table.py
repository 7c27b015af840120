"""The table of drives: one row per episode and condition, read and written as CSV."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from pedpred.driving.forecasters import NAMES
from pedpred.driving.measures import Measures
from pedpred.errors import InputError
from pedpred.files import read_bytes, translate_errors, write_text

_DIGITS = 4
MEASURES = [field.name for field in fields(Measures)]
_WHOLE = [field.name for field in fields(Measures) if field.type == "int"]
_KEYS = ["place", "robot", "method", "risk", "episode", "settings"]


NETWORK = r"[a-z][a-z0-9_]*"
"""Names of methods; those not in `NAMES` are networks."""


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
        method, risk = self.condition
        rank = NAMES.index(method) if method in NAMES else len(NAMES)
        return rank, method, risk, self.episode

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
        InputError: the file is no text, or a line is not a row of such a table.
    """
    wording = partial(InputError, path, "table", remedy="Name another table, or remove this one")
    rows = []
    with translate_errors(wording):
        lines = csv.DictReader(io.StringIO(read_bytes(path).decode("utf-8-sig")))
        for number, cells in enumerate(lines, 2):
            try:
                rows.append(_row(cells))
            except (KeyError, ValueError, TypeError) as cause:
                raise wording(f"line {number} is not a row of a table of drives ({cause})") from cause
        if lines.fieldnames and not {*_KEYS, *MEASURES} <= {*lines.fieldnames}:
            raise wording("line 1 is not the first line of a table of drives")
    return rows


def _row(cells: Mapping[str, str]) -> Row:
    """A row of the table.

    Raises:
        KeyError, ValueError, TypeError: it is none.
    """
    condition = Condition(cells["method"], float(cells["risk"]))
    if not re.fullmatch(NETWORK, condition.method):
        raise ValueError(condition.method)
    figures: dict[str, Any] = {name: (int if name in _WHOLE else float)(cells[name]) for name in MEASURES}
    keys = cells["place"], cells["robot"], condition, int(cells["episode"]), cells["settings"]
    return Row(*keys, Measures(**figures))


def write_table(path: Path, rows: Iterable[Row]) -> None:
    """Write a table, by method, limit of risk and episode; the same rows give the same bytes."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [*_KEYS, *MEASURES], lineterminator="\n")
    writer.writeheader()
    writer.writerows(row.values() for row in sorted(rows, key=lambda row: row.order))
    write_text(path, text.getvalue())
