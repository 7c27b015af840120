"""What options of the command are called where a data frame is given: in errors, and in what is logged."""

from __future__ import annotations

import logging
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from pedpred.errors import PedpredError
from pedpred.tables.units import UNITS

_COLUMNS = re.compile(r"--columns(?: (\w+(?:,\w+)+))?")
_ARGUMENTS = {
    r"--rate\b": "rate_hz",
    r"--map ": "",
    r"titles, comments or --unit": "titles or unit",
    r"the comment, --unit or --scale": "unit",
    rf"--unit ({'|'.join(UNITS)})\b": r'unit="\1"',
    r"--unit\b": "unit",
    r"--scale, --homography, ": "",
    r"--scale if": "scale them if",
    r"Say how long .*: --scale [\d.]+, or give --homography \S+": "Bring them to metres first",
    r"make pixels of them, and give --scale or --homography": "bring them to metres first",
    r"--class chooses": "leave out the rows of others",
    r"leave --class out": "give all rows",
    r"Name a file with tracks": "Give a table with tracks",
    r"make a file for each": "make a table for each",
    r"([Dd])ivide the file": r"\1ivide the table",
    r"; expected commas, .* between them": "",
}
"""Options, and words about files, and what stands for them."""


def in_python(text: str) -> str:
    """A message in which options of the command are what a caller in Python can change."""
    text = _COLUMNS.sub(_as_titles, text)
    for option, argument in _ARGUMENTS.items():
        text = re.sub(option, argument, text)
    return text


def _as_titles(option: re.Match[str]) -> str:
    return f"table.columns = {option[1].split(',')}" if option[1] else "table.columns"


class _Reworded(logging.Filter):
    """Changes what one thread logs."""

    def __init__(self) -> None:
        super().__init__()
        self._thread = threading.get_ident()

    def filter(self, record: logging.LogRecord) -> bool:
        """Let everything pass, in other words."""
        if record.thread in (None, self._thread):
            record.msg, record.args = in_python(record.getMessage()), ()
        return True


@contextmanager
def arguments_for_options() -> Iterator[None]:
    """Let errors and messages of the package name what a caller in Python can change."""
    reworded = _Reworded()
    loggers = [
        logger
        for name, logger in list(logging.root.manager.loggerDict.items())
        if isinstance(logger, logging.Logger) and name.startswith("pedpred.")
    ]
    for logger in loggers:
        logger.addFilter(reworded)
    try:
        yield
    except PedpredError as error:
        error.args = (in_python(str(error)), *error.args[1:])
        raise
    finally:
        for logger in loggers:
            logger.removeFilter(reworded)
