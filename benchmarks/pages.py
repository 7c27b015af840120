"""Tables of benchmarks on pages of the documents."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from numbers import Number
from pathlib import Path
from typing import Any

from pedpred.files import write_text
from tools.readme import filled

PAGE = Path("docs/robustness.md")
WRITE = f"write the table into {PAGE}"
"""Help of the option."""


def markdown(rows: Sequence[dict[str, Any]]) -> str:
    """Build a table; the rows share their keys, and numbers stand at the right."""
    right = ["---:" if isinstance(value, Number) else "---" for value in rows[0].values()]
    lines = [rows[0], right, *([_cell(value) for value in row.values()] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def put(mark: str, rows: Sequence[dict[str, Any]], page: Path = PAGE) -> None:
    """Replace the table of this name on a page; without rows it stays, and that is said."""
    if rows:
        fill(page, mark, markdown(rows))
    else:
        print(f"{page}: the table '{mark}' stays as it is, since nothing is there to write", file=sys.stderr)


def fill(page: Path, mark: str, table: str) -> None:
    """Write a table between its marks on a page; who reads it meanwhile sees the old page or the new one."""
    write_text(page, filled(page.read_text(encoding="utf-8"), {mark: table}))


def _cell(value: object) -> str:
    if not isinstance(value, float):
        return str(value).replace("|", "\\|")
    return f"{value:.3f}" if math.isfinite(value) else "-"
