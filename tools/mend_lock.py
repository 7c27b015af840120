"""Repair the files that a killed `dvc repro` left half written: `python -m tools.mend_lock`.

`make reproduce` starts with it. DVC writes dvc.lock in place: after a kill during that write the file ends
within a stage's entry, and later entries are lost. Every stage makes a copy of the file when it starts, which
has them. Restored entries are safe: DVC compares them with the files and runs the stage again where they
differ. DVC's list of files in use (rwlock) can be cut likewise; after a kill it is removed.
"""

from __future__ import annotations

import argparse
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
"""The files that running DVC commands read and write."""
_ENTRY = re.compile(r"^(?= {2}[^\s-])", re.MULTILINE)


def whole(text: str) -> bool:
    """Return whether a lock file ends with a whole line and matches DVC's schema."""
    try:
        validate(yaml.safe_load(text), COMPILED_LOCKFILE_SCHEMA)
    except (yaml.YAMLError, YAMLValidationError):
        return False
    return text.endswith("\n")


def mended(cut: str, earlier: str) -> str:
    """Drop the entry in which a lock file was cut, add entries of an earlier one; may be empty."""
    head, *entries = _ENTRY.split(cut)
    earlier_head, *known = _ENTRY.split(earlier)
    found = {name(entry): entry for entry in entries[:-1]}
    lost = {name(entry): entry for entry in known if name(entry) not in found}
    head = head if entries else earlier_head
    return "".join([head, *found.values(), *lost.values()]) if found or lost else ""


def name(entry: str) -> str:
    """Return the name of the stage of an entry."""
    return entry.partition("\n")[0]


def remove_damaged_rwlock() -> None:
    """Remove the list of files in use if it is damaged."""
    if not RUNNING.exists():
        return
    with make_lock(f"{RUNNING}.lock", tmp_dir=str(RUNNING.parent)):  # as DVC does before it looks
        try:
            json.loads(RUNNING.read_text())
        except ValueError:
            logging.warning("%s is damaged, as after a kill; removed", RUNNING)
            RUNNING.unlink()


def main(arguments: list[str] | None = None) -> None:
    """Repair both files if necessary and keep a copy of dvc.lock for the next time."""
    argparse.ArgumentParser(prog="python -m tools.mend_lock", description=__doc__).parse_args(arguments)
    remove_damaged_rwlock()
    if LOCK.exists() and not whole(text := LOCK.read_text()):
        logging.warning("dvc.lock is cut, as after a kill; missing entries come from %s", KEPT)
        if kept := mended(text, KEPT.read_text() if KEPT.exists() else ""):
            write_text(LOCK, kept)
        else:
            LOCK.unlink()
    keep_lock(Path())


if __name__ == "__main__":
    main()
