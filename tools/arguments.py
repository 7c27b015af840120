"""Command lines of tools and benchmarks: numbers, files that they write, and commands without arguments.

All is checked before any work is done.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from pedpred.errors import InputError, OutputError
from pedpred.files import check_output


def in_project(folder: Path) -> None:
    """Check that a folder is the project's, since tools name its files from there.

    Raises:
        InputError: it is not.
    """
    if not (folder / "dvc.yaml").is_file():
        raise InputError(folder.resolve(), "", "there is no dvc.yaml", "Run this in the project's folder")


def no_arguments(module: str, about: str | None) -> None:
    """Print help if it is asked for, and refuse anything else, before any work is done.

    Args:
        module: as in `python -m tools.prose`.
        about: what it does.
    """
    form = argparse.RawDescriptionHelpFormatter
    argparse.ArgumentParser(prog=f"python -m {module}", description=about, formatter_class=form).parse_args()


def count(text: str) -> int:
    """Return a number of things, at least one.

    Raises:
        ArgumentTypeError: it is none.
    """
    if not (text.isdecimal() and int(text)):
        raise argparse.ArgumentTypeError(f"{text!r}: it must be a whole number of at least 1")
    return int(text)


def positive(text: str) -> float:
    """Return an amount of something, such as seconds.

    Raises:
        ArgumentTypeError: it is none.
    """
    if not 0 < (value := _number(text)) < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r}: it must be a number above 0")
    return value


def probability(text: str) -> float:
    """Return a probability below 1.

    Raises:
        ArgumentTypeError: it is none.
    """
    if not 0 <= (value := _number(text)) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: it must be a number from 0 to below 1")
    return value


def output(text: str) -> Path:
    """Return the path of a file that can be written.

    Raises:
        ArgumentTypeError: it cannot.
    """
    try:
        check_output(Path(text))
    except OutputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return Path(text)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
