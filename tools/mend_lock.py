"""Repair what a killed `dvc repro` left half written: `python -m tools.mend_lock`.

`make reproduce` starts with it. DVC writes dvc.lock in place: after a kill during that write the file ends
within a stage's entry. The copy that every stage makes when it starts then takes its place; stages that have
ended since run again. DVC's list of files in use (rwlock) can be cut likewise and is removed.
"""

from __future__ import annotations

import json
import logging
from pathlib import Path

import yaml
from dvc.lock import make_lock
from dvc.schema import COMPILED_LOCKFILE_SCHEMA
from dvc.utils.strictyaml import YAMLValidationError, validate

from pedpred.config import KEPT, LOCK, keep_lock
from pedpred.errors import user_errors
from tools.arguments import no_arguments

RUNNING = Path(".dvc/tmp/rwlock")
"""The files that running DVC commands read and write."""


def is_whole(lock: Path) -> bool:
    """Return whether a lock file exists, ends with a whole line and matches DVC's schema."""
    try:
        text = lock.read_bytes().decode()
        validate(yaml.load(text, yaml.CSafeLoader), COMPILED_LOCKFILE_SCHEMA)
    except (FileNotFoundError, UnicodeDecodeError, yaml.YAMLError, YAMLValidationError):
        return False
    return text.endswith("\n")


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


@user_errors()
def main() -> None:
    """Repair the files if necessary and keep a copy of dvc.lock for the next time."""
    remove_damaged_rwlock()
    if LOCK.exists() and not is_whole(LOCK):
        logging.warning("dvc.lock is cut, as after a kill; the copy %s takes its place", KEPT)
        if is_whole(KEPT):
            KEPT.replace(LOCK)
        else:
            LOCK.unlink()
    keep_lock(Path())


if __name__ == "__main__":
    no_arguments("tools.mend_lock", __doc__)
    main()
