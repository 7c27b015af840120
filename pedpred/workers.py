"""Many independent jobs at once: on this machine's cores, or on a cluster's.

`$PEDPRED_JOBS` says how many at a time (all cores by default). `$PEDPRED_BACKEND=dask` takes them to
the cluster whose scheduler `$DASK_SCHEDULER_ADDRESS` names (else to one within this machine); its machines
must see the project's folder under the same path. In a program of your own any backend of joblib's will
do, ray's too:

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

from pedpred.errors import ConfigError, WorkerError

Result = TypeVar("Result")


def in_parallel(
    job: Callable[..., Result], tasks: Sequence[Iterable[Any]], title: str, unit: str
) -> list[Result]:
    """Call `job(*task)` for every task, several at a time, beside a progress bar.

    Args:
        job: returns little; what is large it writes to a file of its own.
        tasks: the arguments of each call.
        title: what the progress bar says.
        unit: what one task is.

    Returns:
        What the jobs returned, in the order of the tasks.

    Raises:
        ConfigError: there is no such backend.
        WorkerError: a worker process was killed.
    """
    with backend(os.environ.get("PEDPRED_BACKEND")):
        workers = Parallel(n_jobs=int(os.environ.get("PEDPRED_JOBS", -1)), return_as="generator")
        done = workers(delayed(job)(*task) for task in tasks)
        try:
            return list(tqdm(done, total=len(tasks), desc=title, unit=unit))
        except BrokenProcessPool as cause:
            raise WorkerError(title) from cause


@contextmanager
def backend(name: str | None) -> Iterator[None]:
    """Let joblib work there; None leaves it as it is configured.

    Raises:
        ConfigError: there is no such backend, or its package is not installed.
    """
    if name is None:
        yield
    elif name == "dask":
        try:
            from distributed import Client
        except ImportError as cause:
            raise ConfigError("$PEDPRED_BACKEND", name, "pip install 'dask[distributed]' first") from cause
        with Client(), parallel_config(backend="dask"):
            yield
    else:
        raise ConfigError("$PEDPRED_BACKEND", name, "leave it away, or set it to dask")
