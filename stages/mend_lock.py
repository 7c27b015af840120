"""Take back what a killed `dvc repro` left half written in dvc.lock; `make reproduce` begins with it.

DVC writes the file in place. After a kill in that moment it ends within a stage's entry, and DVC refuses it.
The entries before are whole, so they stay; stages without one come from DVC's run cache or run again.
"""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Any

import yaml
from dvc.schema import COMPILED_LOCKFILE_SCHEMA
from dvc.utils.strictyaml import YAMLValidationError, validate

from pedpred.files import write_text

LOCK = Path("dvc.lock")
ENTRY = re.compile(r" {2}[^\s-]")
"""First line of a stage's entry."""


def accepted(text: str) -> dict[str, Any] | None:
    """The lock file's contents, None where DVC would refuse them."""
    try:
        return validate(yaml.safe_load(text), COMPILED_LOCKFILE_SCHEMA)
    except (yaml.YAMLError, YAMLValidationError):
        return None


def mended(text: str) -> str:
    """The longest beginning of a lock file, up to the end of an entry, that DVC accepts; may be empty."""
    lines = text.splitlines(keepends=True)
    while lines and accepted("".join(lines)) is None:
        entries = [at for at, line in enumerate(lines) if ENTRY.match(line)]
        lines = lines[: entries[-1]] if entries else []
    return "".join(lines)


def main() -> None:
    """Mend dvc.lock, if it needs that."""
    if not LOCK.exists():
        return
    text = LOCK.read_text()
    if accepted(text) is not None:
        return
    logging.warning("dvc.lock ended in the middle of an entry, as after a kill; its whole entries stay")
    if kept := mended(text):
        write_text(LOCK, kept)
    else:
        LOCK.unlink()


if __name__ == "__main__":
    main()
