"""Types of options of tools and benchmarks, which argparse checks before any work is done."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import TypeVar

from pedpred.errors import InputError, OutputError
from pedpred.files import check_output

T = TypeVar("T", int, float)


def in_project(folder: Path) -> None:
    """Check that a folder is the project's, since tools name its files from there.

    Raises:
        InputError: it is not.
    """
    if not (folder / "dvc.yaml").is_file():
        raise InputError(folder.resolve(), "", "there is no dvc.yaml", "Run this in the project's folder")


def no_arguments(module: str, about: str | None) -> None:
    """Parse the command line of a module that takes no arguments; `about` is its help."""
    form = argparse.RawDescriptionHelpFormatter
    argparse.ArgumentParser(prog=f"python -m {module}", description=about, formatter_class=form).parse_args()


def count(text: str) -> int:
    """Parse a whole number of at least 1."""
    return _number(int, text, lambda n: n >= 1, "a whole number of at least 1")


def positive(text: str) -> float:
    """Parse a finite number above 0."""
    return _number(float, text, lambda x: 0 < x < inf, "a number above 0")


def probability(text: str) -> float:
    """Parse a probability below 1."""
    return _number(float, text, lambda x: 0 <= x < 1, "a number from 0 to below 1")


def output(text: str) -> Path:
    """Parse the path of a file that can be written."""
    try:
        check_output(Path(text))
    except OutputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return Path(text)


def _number(kind: Callable[[str], T], text: str, holds: Callable[[T], bool], rule: str) -> T:
    try:
        value = kind(text)
    except ValueError:
        value = None
    if value is None or not holds(value):
        raise argparse.ArgumentTypeError(f"{text!r}: it must be {rule}")
    return value
