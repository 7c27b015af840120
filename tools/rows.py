"""Rows of conf/ that tools write: a comment, a key, its indented lines, and a blank line to the next row."""

from __future__ import annotations

import re
from pathlib import Path

from pedpred.files import write_text


def write_row(path: Path, key: str, row: str) -> None:
    """Replace the row `key` of a configuration file, with its comment, or append it.

    Args:
        path: a file under conf/.
        key: of the row.
        row: its comment, its key and its lines.
    """
    blocks = path.read_text().rstrip("\n").split("\n\n")
    numbers = [k for k, block in enumerate(blocks) if re.search(rf"^{re.escape(key)}:", block, re.MULTILINE)]
    place = numbers[0] if numbers else len(blocks)
    blocks[place : place + 1] = [row.rstrip("\n")]
    write_text(path, "\n\n".join(blocks) + "\n")
