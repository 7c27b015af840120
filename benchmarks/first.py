"""CPU time of the first forecast after an installation, which compiles loops, and of a later process.

`python -m benchmarks.first`. Needs no more than `pip install .`. Both follow the import of `pedpred.online`,
in processes of their own; compiled code goes to an empty folder instead of the one beside the source.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

_SCRIPT = """
import time
import numpy as np
from pedpred.online import OnlinePredictor

before = time.process_time()
OnlinePredictor.load().update(0.0, np.arange(4), np.eye(4, 2))
print(time.process_time() - before)
"""


def first_forecasts() -> list[tuple[float, str]]:
    """CPU seconds of the first forecast of two processes, one after the other, and what each logged."""
    with tempfile.TemporaryDirectory() as cache:
        environment = os.environ | {"NUMBA_CACHE_DIR": cache}
        done = [
            subprocess.run(
                [sys.executable, "-c", _SCRIPT], env=environment, capture_output=True, text=True, check=True
            )
            for _ in range(2)
        ]
    return [(float(one.stdout), one.stderr) for one in done]


def main() -> None:
    """Measure and print."""
    (compiling_s, _), (later_s, _) = first_forecasts()
    print(f"first forecast after an installation {compiling_s:.1f} s of CPU time, later ones {later_s:.2f} s")


if __name__ == "__main__":
    main()
