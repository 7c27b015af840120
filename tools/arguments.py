"""Command lines of tools and benchmarks: numbers of things, and commands without arguments."""

from __future__ import annotations

import argparse


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
