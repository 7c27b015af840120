"""Rows of conf/ that tools write: a comment, a key and its indented lines."""

from __future__ import annotations

import re
from pathlib import Path

from pedpred.files import write_text


def write_row(path: Path, key: str, row: str) -> None:
    """Replace the row `key` of a configuration file, with its comment, or append it.

    Args:
        path: a file under conf/; one that is not there yet is made.
        key: of the row.
        row: its comment, its key and its lines.
    """
    row, before = row.rstrip("\n") + "\n", path.read_text() if path.exists() else ""
    text = before.rstrip("\n") + "\n"
    present = rf"(?m)^(?:#.*\n)*{re.escape(key)}:.*\n(?:[ \t]+.*\n|\n(?=[ \t]))*"
    changed, found = re.subn(present, lambda _: row, text, count=1)
    write_text(path, changed if found else f"{text}\n{row}".lstrip("\n"))
