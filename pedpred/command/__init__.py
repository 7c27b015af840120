"""Forecast pedestrians in recordings, describe and convert recordings, and evaluate networks."""

from __future__ import annotations

import argparse
import logging
import sys

from pedpred.errors import ValueRuleError, user_errors


@user_errors()
def main(arguments: list[str] | None = None) -> None:
    """Run a command; errors that a user can fix print their message without a traceback."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    words = sys.argv[1:] if arguments is None else arguments
    try:
        from pedpred.command.arguments import check, parser
        from pedpred.command.options import option_of
    except ModuleNotFoundError as missing:
        _run_on_a_robot(words, missing.name)
        return
    asked = parser().parse_args(words)
    try:
        check(asked)
        asked.action(asked)
    except ValueRuleError as error:  # name the option that was given, not its field
        if error.field not in vars(asked) or error.field == "scene":
            raise
        raise ValueRuleError(option_of(error.field), error.value, error.rule) from error


def _run_on_a_robot(words: list[str], missing: str | None) -> None:
    """Run `warm-up`, the only command that needs no library for reading files."""
    from pedpred.command.warming import add_model, add_warm_up

    if words[:1] != ["warm-up"]:
        remedy = "Install it: pip install 'pedpred[files]'. Without it, `pedpred warm-up` alone can run"
        raise SystemExit(f"pedpred: {missing} is not installed. {remedy}")
    top = argparse.ArgumentParser(prog="pedpred")
    add_model(add_warm_up(top.add_subparsers()))
    asked = top.parse_args(words)
    asked.action(asked)
