"""Describe and convert recordings of pedestrians, forecast in them, evaluate networks; compile beforehand."""

from __future__ import annotations

import logging

from pedpred.errors import user_errors


@user_errors()
def main(arguments: list[str] | None = None) -> None:
    """Run a command; errors that a user can fix print their message without a traceback."""
    from pedpred.command.arguments import check, parser  # takes seconds, in which Ctrl-C ends quietly too

    logging.basicConfig(level=logging.INFO, format="%(message)s")
    given = parser().parse_args(arguments)
    check(given)
    given.action(given)
