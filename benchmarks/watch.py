"""Run a command and say what it used: `python benchmarks/watch.py COMMAND...`, a JSON object on stdout.

cpu_s: of the processor, by the command and its children, s.
peak_mib: most that the largest of these processes ever had in memory, MiB; pages of files that are mapped
count, though the system may take them back at any time.
anonymous_mib: most that all of them held together of what is theirs alone (RssAnon and VmSwap of
/proc/<pid>/status, looked at every 20 ms, so that a shorter peak may be missed), MiB; null without /proc.

A small process of its own: a child counts the memory of its parent until it has begun.
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
    """A process and all that it has started, and these in turn."""
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        children = [int(child) for task in tasks for child in (task / "children").read_text().split()]
    except OSError:  # it has just ended
        return []
    return [pid, *(other for child in children for other in family(child))]


def anonymous_kib(pid: int) -> int:
    """Memory that is a process's own, in or out of a swap file, KiB; 0 when it has just ended."""
    try:
        return sum(map(int, _HELD.findall(Path(f"/proc/{pid}/status").read_text())))
    except OSError:
        return 0


def main() -> None:
    """Start, look, and tell; the command's own output goes to stderr."""
    process = subprocess.Popen(sys.argv[1:], stdout=sys.stderr)
    most = 0
    while process.poll() is None:
        most = max(most, sum(map(anonymous_kib, family(process.pid))))
        time.sleep(PERIOD_S)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, process.args)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    told = {
        "cpu_s": used.ru_utime + used.ru_stime,
        "peak_mib": used.ru_maxrss / 1024,
        "anonymous_mib": most / 1024 if most else None,
    }
    sys.stdout.write(json.dumps(told))


if __name__ == "__main__":
    main()
