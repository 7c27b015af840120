"""Run a command and measure it: `python benchmarks/watch.py COMMAND...` writes a JSON object to stdout.

cpu_s: CPU time of the command and its children, s.
peak_mib: peak resident memory of the largest of these processes, MiB, with pages of mapped files, though
the system may evict them at any time.
anonymous_mib: peak private memory of all of them together, MiB (RssAnon and VmSwap of /proc/<pid>/status,
sampled every 20 ms, so that a shorter peak may be missed); null without /proc.

This is a small process of its own, because a child's peak includes its parent's memory until it calls exec.
"""

from __future__ import annotations

import json
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

PERIOD_S = 0.02
_HELD = re.compile(r"^(?:RssAnon|VmSwap):\s+(\d+) kB", re.MULTILINE)


def family(pid: int) -> list[int]:
    """Return a process and all its descendants."""
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        children = [int(child) for task in tasks for child in (task / "children").read_text().split()]
    except OSError:  # it has just ended
        return []
    return [pid, *(other for child in children for other in family(child))]


def anonymous_kib(pid: int) -> int:
    """Return the private memory of a process, in RAM and in swap, KiB; 0 if it has just ended."""
    try:
        return sum(map(int, _HELD.findall(Path(f"/proc/{pid}/status").read_text())))
    except OSError:
        return 0


def main() -> None:
    """Run the command and print the figures; the command's own output goes to stderr."""
    process = subprocess.Popen(sys.argv[1:], stdout=sys.stderr)
    peak = 0
    while process.poll() is None:
        peak = max(peak, sum(map(anonymous_kib, family(process.pid))))
        time.sleep(PERIOD_S)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, process.args)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    figures = {
        "cpu_s": used.ru_utime + used.ru_stime,
        "peak_mib": used.ru_maxrss / 1024,
        "anonymous_mib": peak / 1024 if peak else None,
    }
    sys.stdout.write(json.dumps(figures))


if __name__ == "__main__":
    main()
