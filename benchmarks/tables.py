"""Print figures of benchmarks as tables, and write them to JSON files and pages."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from numbers import Number
from pathlib import Path
from typing import Any

from pedpred.files import write_json, write_text
from tools.readme import filled

REPORT = Path("reports/benchmarks.md")
"""Page of the tables that docs/ only links to."""

Rows = Sequence[Mapping[str, Any]]
"""Rows of a table: column -> cell; all have the columns of the first."""


def show(title: str, rows: Rows) -> None:
    """Print a table."""
    cells = [list(rows[0])] if rows else [["no rows"]]
    cells += [[f"{v:.4g}" if isinstance(v, float) else str(v) for v in row.values()] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    print(f"\n{title}")
    for line in cells:
        print("  " + "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))


def keep(figures: Mapping[str, Any], path: Path | None) -> None:
    """Write figures as JSON if a path is given; NaN and infinity become null."""
    if path is not None:
        write_json(path, _finite(figures))


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def markdown(rows: Rows) -> str:
    """Build a Markdown table; columns of numbers are aligned at the right."""
    rule = ["---:" if isinstance(value, Number) else "---" for value in rows[0].values()]
    lines = [rows[0], rule, *([_cell(value) for value in row.values()] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cell(value: object) -> str:
    if not isinstance(value, float):
        return str(value).replace("|", "\\|")
    return f"{value:.3f}" if math.isfinite(value) else "-"


def write_tables(page: Path, tables: Mapping[str, Rows]) -> None:
    """Replace the tables of these names on a page, all at once; tables without rows stay."""
    texts = {name: markdown(rows) for name, rows in tables.items() if rows}
    write_text(page, filled(page.read_text(encoding="utf-8"), texts))


def check_options_of_page(
    parser: argparse.ArgumentParser, options: argparse.Namespace, inputs: Sequence[str] = ()
) -> None:
    """Refuse `--write` beside options that change figures, since pages name commands without any.

    Args:
        parser: ends the program.
        options: as given.
        inputs: options that name what is measured, which the tables name as well.
    """
    changed = {key for key, value in vars(options).items() if value != parser.get_default(key)}
    if options.write and (others := sorted(changed - {"write", *inputs})):
        parser.error(f"--write is for the default options: leave out --write, or --{', --'.join(others)}")
