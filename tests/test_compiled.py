"""Compiled loops: one thread, whoever calls them; the first time is announced and takes seconds."""

import itertools
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from benchmarks.beside import busy
from pedpred.online import OnlinePredictor

MANY = """
import os, sys, threading
import numpy as np
from pedpred.features import FeatureSettings, Neighbours, Pedestrians, observe
from pedpred.scenes import OccupancyMap

rng = np.random.default_rng(0)
people = Pedestrians(np.arange(3000), rng.uniform(0, 60, (3000, 2)), np.zeros(3000), np.ones((3000, 2)))
ground = OccupancyMap(rng.random((600, 600)) < 0.1, np.zeros(2), 0.1)

def seen():
    return observe(people, Neighbours.together(people, 3000), ground, FeatureSettings())

threads = len(os.listdir("/proc/self/task"))
first = seen()
"""
ENDS = {
    "no thread is started": "sys.exit(len(os.listdir('/proc/self/task')) - threads)",
    "a forked process may go on": """
child = os.fork()
if not child:
    os._exit(int(not np.array_equal(seen().occupancy, first.occupancy)))
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
""",
    "two threads may call at once": """
found = []
both = [threading.Thread(target=lambda: found.extend(seen().occupancy for _ in range(20))) for _ in range(2)]
for one in both:
    one.start()
for one in both:
    one.join()
sys.exit(sum(not np.array_equal(own, first.occupancy) for own in found) + abs(len(found) - 40))
""",
}


def run(script, **environment):
    command = [sys.executable, "-c", script]
    return subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, check=False)


def test_loops_are_compiled_in_one_way():
    sources = (Path(__file__).parents[1] / "pedpred").rglob("*.py")
    assert [path.name for path in sources if "from numba" in path.read_text()] == ["compiled.py"]


@pytest.mark.skipif(sys.platform != "linux", reason="threads are counted in /proc")
@pytest.mark.parametrize("end", ENDS)
def test_loops_run_in_the_calling_thread(end):
    done = run(MANY + ENDS[end], NUMBA_NUM_THREADS="4", OMP_NUM_THREADS="4")
    assert done.returncode == 0, done.stderr


def test_compiling_is_announced_once(tmp_path):
    script = "from numpy import zeros\nfrom pedpred.features.history import spaced\n"
    script += "spaced(zeros(1), zeros(1, int))"
    said, silence = (run(script, NUMBA_CACHE_DIR=str(tmp_path)).stderr for _ in range(2))
    assert said.count("compiling") == said.count("`pedpred warm-up` does it beforehand") == 1
    assert not silence


@pytest.mark.parametrize("count", [4, 20])
def test_an_update_takes_as_much_work_beside_busy_processes(count):
    """CPU time, to which threads that wait busily would add; the least, since other work fills the caches."""
    predictor, places = OnlinePredictor.load(), np.random.default_rng(0).uniform(0, 10, (count, 2))
    frames = itertools.count(1)

    def work_s():
        before = time.process_time()
        predictor.update(0.1 * next(frames), np.arange(count), places)
        return time.process_time() - before

    def least():
        return min(work_s() for _ in range(100))

    least()
    alone = least()
    with busy(2):
        assert least() < 1.5 * alone
