"""Compare the metrics with those of a revision: `python -m tools.compare HEAD~1`.

Lists the figures of reports/metrics that moved beyond their 95 % intervals; exit code 1 when some got worse.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pedpred.errors import InputError, user_errors
from pedpred.report.comparison import changes, changes_table, metrics_at, metrics_now


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
