"""Tables of benchmarks on pages of the documents."""

from __future__ import annotations

import argparse
import math
import shlex
import sys
from collections.abc import Iterator, Sequence
from numbers import Number
from pathlib import Path
from typing import Any

from pedpred.files import write_text
from tools.readme import filled

PAGE = Path("docs/robustness.md")


def table_parser(about: str) -> argparse.ArgumentParser:
    """Begin the options of a benchmark that makes a table of `PAGE`; `about`: its docstring."""
    parser = argparse.ArgumentParser(description=about.partition("\n\n")[0])
    parser.add_argument("--model", type=Path, help="a model folder; by default the shipped one")
    return parser


def add_trust(parser: argparse.ArgumentParser) -> None:
    """Add the option to learn how far to trust the network."""
    told = "learn how far to trust the network, as robots do"
    parser.add_argument("--trust", action="store_true", help=told)


def table_options(parser: argparse.ArgumentParser, module: str) -> argparse.Namespace:
    """Add --write and parse; the figures to write must be those of a command of `PAGE`."""
    parser.prog = f"python -m {module}"
    parser.add_argument("--write", action="store_true", help=f"write the table into {PAGE}")
    options = parser.parse_args()
    check_command(parser, options, module)
    return options


def check_command(
    parser: argparse.ArgumentParser,
    options: argparse.Namespace,
    module: str,
    page: Path = PAGE,
    beside: Sequence[str] = (),
) -> None:
    """Refuse to write figures that a page does not say: its command makes them, with these options.

    Args:
        parser: of the options; it ends the program.
        options: as given. Files may lie in other folders than on the page.
        module: as in `benchmarks.noise`.
        page: with the command in a line of its own.
        beside: options that change no table.
    """
    if not options.write:
        return
    given, commands = vars(options), list(_commands(module, page))
    for command in commands:
        shown = vars(parser.parse_args(shlex.split(command, comments=True)[3:]))
        if all(name in beside or _plain(value) == _plain(shown[name]) for name, value in given.items()):
            return
    rule = "other figures stay out of the page: leave out --write, or first change the command there"
    parser.error(f"--write is for a command of {page}, {' or '.join(commands) or 'which has none'}; {rule}")


def _commands(module: str, page: Path) -> Iterator[str]:
    """The commands of a page that write its tables by a benchmark."""
    for line in page.read_text(encoding="utf-8").splitlines():
        command = line.partition(" #")[0].strip()
        if command.startswith(f"python -m {module} ") and "--write" in command.split():
            yield command


def _plain(value: object) -> object:
    """What counts of the value of an option: of paths, the names, in any order."""
    if isinstance(value, list) and all(isinstance(each, Path) for each in value):
        return sorted(each.name for each in value)
    return value.name if isinstance(value, Path) else value


def markdown(rows: Sequence[dict[str, Any]]) -> str:
    """Build a table; the rows share their keys, and numbers stand at the right."""
    right = ["---:" if isinstance(value, Number) else "---" for value in rows[0].values()]
    lines = [rows[0], right, *([_cell(value) for value in row.values()] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def put(mark: str, rows: Sequence[dict[str, Any]], page: Path = PAGE) -> None:
    """Replace the table of this name on a page; without rows it stays, and that is said."""
    if rows:
        fill(page, mark, markdown(rows))
    else:
        print(f"{page}: the table '{mark}' stays as it is, since nothing is there to write", file=sys.stderr)


def fill(page: Path, mark: str, table: str) -> None:
    """Write a table between its marks on a page; who reads it meanwhile sees the old page or the new one."""
    write_text(page, filled(page.read_text(encoding="utf-8"), {mark: table}))


def _cell(value: object) -> str:
    if not isinstance(value, float):
        return str(value).replace("|", "\\|")
    return f"{value:.3f}" if math.isfinite(value) else "-"
