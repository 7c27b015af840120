"""Mend what a killed `dvc repro` left half written of its own; `make reproduce` begins with it.

DVC writes dvc.lock in place: after a kill in that moment it ends within a stage's entry, and the entries
behind are gone. Every stage keeps a copy of it when it begins, which has them. An entry is no more than a
claim: DVC compares it with the files, and runs the stage again where they differ. The note of what DVC is
reading and writing just now (rwlock) suffers likewise, and is worth nothing after a kill.
"""

from __future__ import annotations

import json
import logging
import re
from pathlib import Path

import yaml
from dvc.lock import make_lock
from dvc.schema import COMPILED_LOCKFILE_SCHEMA
from dvc.utils.strictyaml import YAMLValidationError, validate

from pedpred.config import KEPT, LOCK, keep_lock
from pedpred.files import write_text

RUNNING = Path(".dvc/tmp/rwlock")
"""Who reads and writes what, of all DVC commands that run here."""
_ENTRY = re.compile(r"^(?= {2}[^\s-])", re.MULTILINE)


def whole(text: str) -> bool:
    """Whether a lock file ends where it should, as far as can be seen, and DVC accepts it."""
    try:
        validate(yaml.safe_load(text), COMPILED_LOCKFILE_SCHEMA)
    except (yaml.YAMLError, YAMLValidationError):
        return False
    return text.endswith("\n")


def mended(cut: str, earlier: str) -> str:
    """A lock file without the entry in which it was cut, completed from an earlier one; may be empty."""
    head, *entries = _ENTRY.split(cut)
    earlier_head, *known = _ENTRY.split(earlier)
    found = {name(entry): entry for entry in entries[:-1]}
    lost = {name(entry): entry for entry in known if name(entry) not in found}
    head = head if entries else earlier_head
    return "".join([head, *found.values(), *lost.values()]) if found or lost else ""


def name(entry: str) -> str:
    """Of an entry's stage."""
    return entry.partition("\n")[0]


def forget_the_killed() -> None:
    """Remove the note of what is read and written, if nobody can read it."""
    if not RUNNING.exists():
        return
    with make_lock(f"{RUNNING}.lock", tmp_dir=str(RUNNING.parent)):  # as DVC does before it looks
        try:
            json.loads(RUNNING.read_text())
        except ValueError:
            logging.warning("%s ends in the middle, as after a kill; it is forgotten", RUNNING)
            RUNNING.unlink()


def main() -> None:
    """Mend both files, if they need that, and keep a copy of dvc.lock for the next time."""
    forget_the_killed()
    if LOCK.exists() and not whole(text := LOCK.read_text()):
        logging.warning("dvc.lock ends in the middle, as after a kill; what was lost comes from %s", KEPT)
        if kept := mended(text, KEPT.read_text() if KEPT.exists() else ""):
            write_text(LOCK, kept)
        else:
            LOCK.unlink()
    keep_lock(Path())


if __name__ == "__main__":
    main()
