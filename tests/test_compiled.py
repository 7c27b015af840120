"""Compiled loops run in the calling thread; compiling is announced once."""

import os
import subprocess
import sys

import pytest

from tests.conftest import ROOT
from tests.forked import run_forked

MANY = """
import os, threading
import numpy as np
import scipy.linalg  # numba loads it, if it is there, and its BLAS has threads that wait
from benchmarks.features import both_grids
from pedpred.features import Pedestrians
from pedpred.scenes import OccupancyMap

rng = np.random.default_rng(0)
people = Pedestrians(np.arange(300), rng.uniform(0, 30, (300, 2)), np.zeros(300), np.ones((300, 2)))
ground = OccupancyMap(rng.random((300, 300)) < 0.1, np.zeros(2), 0.1)

def seen():
    return both_grids(people, ground)["occupancy"]

threads = len(os.listdir("/proc/self/task"))
first = seen()
assert len(os.listdir("/proc/self/task")) == threads, "no thread is started"
child = os.fork()
if not child:
    os._exit(int(not np.array_equal(seen(), first)))
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0, "a forked process may go on"
found = []
both = [threading.Thread(target=lambda: found.extend(seen() for _ in range(10))) for _ in range(2)]
for one in both:
    one.start()
for one in both:
    one.join()
assert len(found) == 20, "two threads may call at once"
assert all(np.array_equal(own, first) for own in found)
"""
UPDATES = """
import os, sys
import numpy as np
from pedpred.online import OnlinePredictor

predictor = OnlinePredictor.load()
threads = len(os.listdir("/proc/self/task"))
for frame in range(20):
    predictor.update(0.1 * frame, np.arange(20), np.random.default_rng(0).uniform(0, 10, (20, 2)))
sys.exit(len(os.listdir("/proc/self/task")) - threads)
"""


def test_only_one_module_imports_numba():
    sources = (ROOT / "pedpred").rglob("*.py")
    assert [path.name for path in sources if "from numba" in path.read_text()] == ["compiled.py"]


@pytest.mark.skipif(sys.platform != "linux", reason="needs Linux")
@pytest.mark.parametrize("script", [MANY, UPDATES], ids=["loops", "updates"])
def test_loops_run_in_the_calling_thread(script):
    threads = {"NUMBA_NUM_THREADS": "4", "OMP_NUM_THREADS": "4"}
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, env=os.environ | threads, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_compiling_is_announced_once(tmp_path):
    script = "from numpy import zeros\nfrom pedpred.tracking.spacing import spaced\n"
    script += "spaced(zeros(1), zeros(1, int))"
    cache = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    said, silence = (run_forked(script, ROOT, cache).stderr for _ in range(2))
    assert said.count("pedpred warm-up") == 1
    assert not silence
