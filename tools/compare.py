"""Compare the metrics with those of a revision: `python -m tools.compare HEAD~1`.

Lists the figures of reports/metrics that moved beyond their 95 % intervals; exit code 1 when some got worse.
A figure moved when it lies outside its earlier 95 % interval. The interval may be missing, where no replicate
had a value, as for a metric of one person in a small bootstrap. A difference to the reference method is
judged only if the method's own figure moved, because otherwise the reference did.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from pedpred.errors import InputError, PedpredError, ValueRuleError, user_errors
from pedpred.files import translate_errors
from pedpred.metrics import METRICS
from pedpred.plain import parse_json
from pedpred.report.document import NOTHING, markdown_table
from pedpred.report.results import REFERENCE_GAP, figure_of, metrics_now, results_frame
from pedpred.report.tables import interval

VERDICTS = ("worse", "vanished", "unjudged", "better", "new", "reference", "within", "same")
"""Verdicts in the order of the table, which leaves the last three out.

`unjudged` moved without an earlier interval, `reference` is a difference that moved with the reference alone.
"""
_KEYS = ["study", "place", "method", "figure"]


def metrics_at(revision: str, folder: Path) -> dict[str, Any]:
    """Read the metric files of a folder of a repository at a git revision, by name.

    Raises:
        InputError: there is no such folder, or it is in no repository.
        ValueRuleError: the revision is unknown.
        InputError: one of the files is damaged there.
    """
    lost = partial(InputError, folder, "", remedy="Name a folder of metrics in a git repository")
    if not folder.is_dir():
        raise lost("there is no such folder")
    _git(folder, lost, "rev-parse", "--git-dir")
    unknown = partial(ValueRuleError, "revision", revision)
    listed = _git(folder, unknown, "ls-tree", "--name-only", "-z", "--end-of-options", revision)
    metrics = {}
    for name in filter(lambda name: name.endswith(".json"), listed.split("\0")):
        remedy = "Compare with another revision"
        with translate_errors(partial(InputError, folder / name, revision, remedy=remedy)):
            text = _git(folder, unknown, "show", "--end-of-options", f"{revision}:./{name}")
            metrics[Path(name).stem] = parse_json(text)
    return metrics


def changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> pd.DataFrame:
    """Compare the metrics of two sets of files, name -> contents.

    Returns:
        A row per metric of either side, in the order of the files: study, place, method, figure, verdict, and
        what was measured `before` and `after`, NaN where it does not exist.
    """
    old, new = _metrics(before), _metrics(after)
    both = new.add_suffix("_after").join(old.add_suffix("_before"))
    gone = old[~old.index.isin(new.index)].add_suffix("_before")
    found = pd.concat([both, gone]) if len(gone) else both
    verdicts = {
        name: _verdict(name[-1], row) for name, row in zip(found.index, found.itertuples(), strict=True)
    }
    for name, verdict in verdicts.items():
        own = (*name[:-1], name[-1].removesuffix(REFERENCE_GAP))
        if own != name and verdict not in ("new", "vanished", "same") and verdicts.get(own) == "same":
            verdicts[name] = "reference"
    return found.assign(verdict=list(verdicts.values())).reset_index()


def _metrics(files: Mapping[str, Any]) -> pd.DataFrame:
    """Value, interval and number of windows of all metrics, by `_KEYS`."""
    frame = results_frame(files)
    judged = frame["figure"].str.removesuffix(REFERENCE_GAP).isin(METRICS) & (frame["step"] == 0)
    windows = frame[frame["figure"] == "windows"].rename(columns={"value": "windows"})
    frame = frame[judged].merge(windows[[*_KEYS[:3], "windows"]], on=_KEYS[:3], how="left")
    return frame.set_index(_KEYS)[["value", "low", "high", "windows"]]


def _verdict(figure: str, row: Any) -> str:
    if pd.isna(row.value_before) or pd.isna(row.value_after):
        return "new" if pd.isna(row.value_before) else "vanished"
    if row.value_after == row.value_before:
        return "same"
    if pd.isna(row.low_before) or pd.isna(row.high_before):
        return "unjudged"
    if row.low_before <= row.value_after <= row.high_before:
        return "within"
    better = METRICS[figure.removesuffix(REFERENCE_GAP)].better
    return "better" if (row.value_after > row.high_before) == (better == "higher") else "worse"


def changes_table(changes: pd.DataFrame) -> str:
    """Write what moved beyond its interval, appeared or vanished as a Markdown table, and count the rest.

    A new figure of a method that was there before is only counted: a new metric would fill pages.
    """
    known = changes.groupby(_KEYS[:3])["value_before"].transform("count") > 0
    listed = changes["verdict"].isin(VERDICTS[:5]) & ~(known & (changes["verdict"] == "new"))
    shown = changes[listed].sort_values("verdict", key=lambda each: each.map(VERDICTS.index), kind="stable")
    rows = [
        [*(getattr(row, key) for key in _KEYS), _worded(row, "before"), _worded(row, "after"), row.verdict]
        for row in shown.itertuples()
    ]
    header = ["file", "scene", "method", "figure", "before (95 % interval)", "now (95 % interval)", "verdict"]
    count = changes["verdict"].value_counts().reindex(VERDICTS, fill_value=0)
    with_reference = f", {count['reference']} moved with the reference alone" if count["reference"] else ""
    unjudged = f", {count['unjudged']} moved without an interval" if count["unjudged"] else ""
    count_line = (
        f"{len(changes)} figures: {count['worse']} worse and {count['better']} better than their earlier "
        f"interval, {count['within']} moved within it, {count['same']} unchanged, "
        f"{count['new'] + count['vanished']} new or vanished{with_reference}{unjudged}."
    )
    return f"{markdown_table(header, rows, texts=7)}\n\n{count_line}" if rows else count_line


def _worded(row: Any, when: str) -> str:
    """What was measured before or after, with its interval and the number of windows."""
    names = {name: getattr(row, f"{name}_{when}") for name in ("value", "low", "high", "windows")}
    if pd.isna(names["value"]):
        return NOTHING
    value, bounds = figure_of(pd.Series(names))
    return f"{value:.3f} ({interval(bounds) if bounds else 'no interval'}), {names['windows']:.0f} windows"


def _git(folder: Path, wording: Callable[[str], PedpredError], *arguments: str) -> str:
    """Run a git command in a folder; where it fails, what git says becomes an error."""
    call = ["git", "-C", str(folder), *arguments]
    done = subprocess.run(call, capture_output=True, text=True, check=False)  # noqa: S603, a list, no shell
    if done.returncode:
        raise wording(f"git says: {done.stderr.strip()}")
    return done.stdout


@user_errors()
def main() -> None:
    """Print the comparison; fail when something got worse beyond its interval."""
    parser = argparse.ArgumentParser(prog="python -m tools.compare", description=__doc__.partition(":")[0])
    parser.add_argument("revision", help="a commit, branch or tag")
    parser.add_argument("--folder", type=Path, default=Path("reports/metrics"))
    options = parser.parse_args()
    moved = changes(metrics_at(options.revision, options.folder), metrics_now(options.folder))
    if moved.empty:
        problem = f"no figures with intervals are there, neither now nor at {options.revision}"
        raise InputError(options.folder, "", problem, "Name the folder of the metric files: --folder")
    sys.stdout.write(f"{changes_table(moved)}\n")
    sys.exit(int("worse" in set(moved["verdict"])))


if __name__ == "__main__":
    main()
