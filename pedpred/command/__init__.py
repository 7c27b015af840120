"""Forecast pedestrians in recordings, describe and convert recordings, and evaluate networks."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence

import pedpred
from pedpred.errors import user_errors


@user_errors()
def main(arguments: list[str] | None = None) -> None:
    """Run a command; errors that a user can fix print their message without a traceback."""
    from pedpred.command.libraries import missing_libraries  # takes seconds, in which Ctrl-C ends quietly too

    logging.basicConfig(level=logging.INFO, format="%(message)s")
    words = sys.argv[1:] if arguments is None else arguments
    if missing := missing_libraries():
        _run_on_a_robot(words, missing)
        return
    from pedpred.command.arguments import check, parser

    asked = parser().parse_args(words)
    check(asked)
    asked.action(asked)


def _run_on_a_robot(words: Sequence[str], missing: Sequence[str]) -> None:
    """Run a command that needs no library for reading files."""
    from pedpred.command.warming import add_model, add_warm_up

    remedy = f"Other commands need {', '.join(missing)}: pip install 'pedpred[files]'."
    top = argparse.ArgumentParser(prog="pedpred", description=__doc__, epilog=remedy)
    top.add_argument("--version", action="version", version=f"pedpred {pedpred.__version__}")
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    add_model(add_warm_up(commands))
    if words and words[0] != "warm-up" and not words[0].startswith("-"):
        raise SystemExit(f"pedpred: {words[0]} is not installed. {remedy}")
    asked = top.parse_args(words)
    asked.action(asked)
