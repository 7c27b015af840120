"""Judge a model folder: `python -m tools.judge [FOLDER] [--against OTHER | --replace OTHER] [--out FILE]`.

Prints a table of promises with the figures behind them; exit code 1 when one is broken. Measured are all
real places in data/scenes/real, as their sensors detect people and the folder's tracker follows them, the
simulated test rooms through a robot's sensor, the laws, and the time of an update. Promises about unseen
places are judged by the metric files of the folds. `--against` another folder, or a revision of this one,
fails when this one is worse beyond the interval of the paired difference. `--replace` copies it over another
folder, unless it is worse or breaks a promise that the other one keeps; `--accept` names what may get worse.
"""

from __future__ import annotations

from tools.programs import compute_in_one_thread, git

if __name__ == "__main__":  # before numpy is loaded: latencies are those of one thread
    compute_in_one_thread()

import argparse
import logging
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import read_params
from pedpred.errors import InputError, ValueRuleError, user_errors
from pedpred.files import atomic_write, check_output, write_json
from pedpred.online.network import ABOUT, GRAPH, read_description
from tools.arguments import output
from tools.judgement import Judgement
from tools.verdicts import Verdict, newly_broken

_TITLES = ("", "about", "what", "found", "limit", "remark")
_WIDTHS = (4, 24, 44, 30, 24, 0)


def folder_at(revision: str, folder: Path, scratch: Path) -> Path | None:
    """Find a model folder to compare with: the named one, or the judged one at a git revision.

    Returns:
        None where `HEAD`, with which models are compared by default, has no such folder.

    Raises:
        ValueRuleError: there is no such folder, and the revision has none.
    """
    if revision and Path(revision).exists():
        return Path(revision)
    for name in (GRAPH, ABOUT):
        done = git("-C", str(folder), "show", "--end-of-options", f"{revision}^{{commit}}:./{name}")
        if done.returncode:
            why = done.stderr.decode(errors="replace").strip()
            if revision != "HEAD":
                rule = f"there is no such folder, and git has no {folder / name} at this revision ({why})"
                raise ValueRuleError("against", revision, rule)
            sys.stdout.write(f"HEAD has no {folder / name}, so nothing is compared ({why})\n")
            return None
        with atomic_write(scratch / folder.name / name) as new:
            new.write_bytes(done.stdout)
    return scratch / folder.name


def check_whole(folder: Path) -> None:
    """Check that the files of a folder are of one model, before minutes of measuring.

    Raises:
        InputError: a file is missing or altered, or they are of two models, as after a kill in `install`.
    """
    try:
        read_description(folder)
    except InputError as error:
        if error.where != "checksum":
            raise
        problem = f"{GRAPH} and {ABOUT} are not those of one model"
        remedy = f"If a replacement was interrupted: `git restore {folder}`; else export or copy it again"
        raise InputError(error.path, error.where, problem, remedy) from error


def install(model: Path, folder: Path) -> None:
    """Copy a model folder over another one, if it is there.

    Each file is replaced atomically; a kill between the two leaves a folder that `check_whole` refuses.
    """
    for name in (GRAPH, ABOUT):
        with atomic_write(folder / name) as new:
            new.write_bytes((model / name).read_bytes())


def line(verdict: Verdict) -> str:
    """Format a verdict as a row of the table."""
    kept = "pass" if verdict.holds else "FAIL"
    return _row(kept, verdict.about, verdict.what, verdict.found, verdict.limit, verdict.remark)


def _row(*cells: str) -> str:
    return "  ".join(c.ljust(w) for c, w in zip(cells, _WIDTHS, strict=True)).rstrip() + "\n"


def print_verdicts(verdicts: Iterable[Verdict]) -> list[Verdict]:
    """Print each verdict as it is measured, then the broken ones again."""
    sys.stdout.write(_row(*_TITLES))
    judged = []
    for verdict in verdicts:
        judged.append(verdict)
        sys.stdout.write(line(verdict))
        sys.stdout.flush()
    broken = [line(verdict) for verdict in judged if not verdict.holds]
    sys.stdout.write(f"\n{len(judged) - len(broken)} of {len(judged)} promises hold\n{''.join(broken)}")
    return judged


def replace(
    folder: Path, model: Path, verdicts: list[Verdict], params: DictConfig, accepted: Sequence[str] = ()
) -> int:
    """Install a model in a folder unless it is worse than the present one; return the exit code.

    Args:
        folder: of the present model, which is judged too if the new one breaks a promise.
        model: the new one.
        verdicts: its verdicts, with the comparison.
        params: of the project.
        accepted: what verdicts are about that may get worse.
    """
    if folder.exists() and not all(verdict.holds for verdict in verdicts):
        sys.stdout.write(f"\nThe same for {folder}:\n")
        worse = newly_broken(verdicts, print_verdicts(Judgement(folder, params).verdicts(None)))
        for verdict in worse:
            if verdict.about in accepted:
                sys.stdout.write(f"\naccepted: {line(verdict)}")
        if refused := [line(verdict) for verdict in worse if verdict.about not in accepted]:
            sys.stdout.write(f"\n{folder} stays as it is; in these {model} is worse:\n{''.join(refused)}")
            return 1
    install(model, folder)
    sys.stdout.write(f"\n{folder} is now {model}\n")
    return 0


@user_errors()
def main(arguments: list[str] | None = None) -> None:
    """Measure, print, and fail when a promise is broken."""
    parser = argparse.ArgumentParser(prog="python -m tools.judge", description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("models/online/default"))
    other = parser.add_mutually_exclusive_group()
    other.add_argument("--against", help="a model folder, or a git revision that has FOLDER")
    other.add_argument("--replace", type=Path, help="a model folder that becomes FOLDER if that is no worse")
    about = "what may get worse when a model is replaced, as the column `about` has it; may be repeated"
    parser.add_argument("--accept", action="append", default=[], metavar="ABOUT", help=about)
    parser.add_argument("--out", type=output, help="write the verdicts there, JSON")
    options = parser.parse_args(arguments)
    if options.accept and not options.replace:
        parser.error("--accept says what may get worse when a model is replaced: name it, --replace OTHER")
    if options.replace:
        check_output(options.replace, folder=True)
    params = read_params(Path())
    check_whole(options.folder)
    judgement = Judgement(options.folder, params)
    with tempfile.TemporaryDirectory() as scratch:
        against = options.replace if options.replace and options.replace.exists() else None
        if options.against:
            against = folder_at(options.against, options.folder, Path(scratch))
        if against is not None:
            check_whole(against)
        verdicts = print_verdicts(judgement.verdicts(against))
    if options.out is not None:
        record: dict[str, Any] = {
            "folder": options.folder.as_posix(),
            "verdicts": [asdict(v) for v in verdicts],
        }
        write_json(options.out, record)
    if options.replace:
        sys.exit(replace(options.replace, options.folder, verdicts, params, options.accept))
    sys.exit(int(not all(verdict.holds for verdict in verdicts)))


if __name__ == "__main__":
    logging.disable(logging.WARNING)
    main()
