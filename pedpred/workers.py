"""Many independent jobs at once: on this machine's cores, or on a cluster's.

`$PEDPRED_JOBS` is the number of jobs at a time (default: all cores). `$PEDPRED_BACKEND=dask` sends them to
the cluster whose scheduler `$DASK_SCHEDULER_ADDRESS` names (default: a cluster on this machine); its machines
must see the project's folder under the same path. In your own programs use any backend of joblib, for example
ray:

    with joblib.parallel_config(backend="ray"):
        in_parallel(job, tasks, "simulate", "room")

Results depend on none of this.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, TypeVar

from joblib import Parallel, delayed, parallel_config
from tqdm import tqdm

from pedpred.errors import PedpredError, ValueRuleError

Result = TypeVar("Result")
_MOST_JOBS = 1024


def in_parallel(
    job: Callable[..., Result], tasks: Sequence[Iterable[Any]], title: str, unit: str
) -> list[Result]:
    """Call `job(*task)` for every task, several at a time; return the results in the order of the tasks.

    Jobs return small values and write large results to files. A progress bar of this title counts the units.

    Raises:
        ValueRuleError: the number of jobs is none, or there is no such backend.
        PedpredError: a worker process was killed.
    """
    with backend(os.environ.get("PEDPRED_BACKEND")):
        jobs = _jobs()
        alone = len(tasks) == 1  # then it runs in this process: a worker takes seconds to start
        workers = Parallel(n_jobs=1 if alone else jobs, return_as="generator")
        done = workers(delayed(job)(*task) for task in tasks)
        try:
            return list(tqdm(done, total=len(tasks), desc=title, unit=unit))
        except BrokenProcessPool as cause:
            raise PedpredError(
                f"{title}: a worker process was killed, perhaps because memory ran out. "
                "No partial results were kept; run it again with fewer workers (PEDPRED_JOBS=1)"
            ) from cause


def _jobs() -> int:
    """Number of jobs at a time, as joblib counts them: -1 means all cores."""
    jobs = os.environ.get("PEDPRED_JOBS")
    if not jobs:
        return -1
    if not (jobs.isdecimal() and 1 <= int(jobs) <= _MOST_JOBS):
        raise ValueRuleError("$PEDPRED_JOBS", jobs, f"it must be unset or a number from 1 to {_MOST_JOBS}")
    return int(jobs)


@contextmanager
def backend(name: str | None) -> Iterator[None]:
    """Use this backend of joblib inside; None: as joblib is configured."""
    if name is None:
        yield
    elif name == "dask":
        try:
            from distributed import Client
        except ImportError as cause:
            rule = "dask is not installed: pip install 'dask[distributed]'"
            raise ValueRuleError("$PEDPRED_BACKEND", name, rule) from cause
        try:
            client = Client()
        except (OSError, ValueError) as cause:
            address = os.environ.get("DASK_SCHEDULER_ADDRESS")
            rule = f"no scheduler answers there: {cause}"
            raise ValueRuleError("$DASK_SCHEDULER_ADDRESS", address, rule) from cause
        with client, parallel_config(backend="dask"):
            yield
    else:
        raise ValueRuleError("$PEDPRED_BACKEND", name, "it must be unset or dask")
