"""Make the wall clock jump by up to a day at every reading, in processes with this folder on $PYTHONPATH."""

import random
import time

DAY_NS = 86_400 * 10**9
_true_ns = time.time_ns
_chance = random.SystemRandom()  # independent of seeds that programs set


def jumping_ns() -> int:
    """Replace `time.time_ns`."""
    return _true_ns() + _chance.randint(-DAY_NS, DAY_NS)


time.time_ns = jumping_ns
time.time = lambda: jumping_ns() / 1e9
