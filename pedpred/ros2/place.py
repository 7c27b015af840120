"""The file that keeps what was learned at a place."""

from __future__ import annotations

import logging
import os
from itertools import count
from pathlib import Path

from pedpred.errors import PedpredError
from pedpred.online import OnlinePredictor

_log = logging.getLogger(__name__)


def load_place(predictor: OnlinePredictor, path: Path | None) -> None:
    """Load the file of the place, if there is one; a file that cannot be used is renamed, with a warning."""
    if path is None or not path.exists():
        return
    try:
        predictor.load_place(path)
    except PedpredError as problem:
        aside = _free_name(path)
        path.replace(aside)  # the name is written soon, and the file may be a mistake
        _log.warning("what was learned before is not used, and now %s: %s", aside, problem)
    else:
        _log.info("continuing with what was learned in %s", path)


def _free_name(path: Path) -> Path:
    """A name beside a file that no other one has."""
    names = (f"{path.name}.unused{number or ''}" for number in count())
    return next(path.with_name(name) for name in names if not os.path.lexists(path.with_name(name)))
