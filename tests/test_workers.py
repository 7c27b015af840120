"""Wherever the work is done, the results are the same bytes."""

import hashlib
import inspect
import pickle
import subprocess
from collections import Counter
from pathlib import Path

import dask
import pytest
from distributed import LocalCluster
from joblib import parallel_config

from pedpred import errors
from pedpred.driving.episodes import DriveSettings
from pedpred.workers import in_parallel
from stages.simulate import simulate_into
from tests.refused import refused
from tests.simulated import SETTINGS, short


def contents(folder):
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(f.relative_to(folder)): hashlib.sha256(f.read_bytes()).hexdigest() for f in files}


def simulated_into(out):
    tasks = [(out, arrangement, SETTINGS) for arrangement in short(6.0, generated=2)]
    in_parallel(simulate_into, tasks, "simulate", "room")
    return contents(out)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    with parallel_config(backend="sequential"):
        return simulated_into(tmp_path_factory.mktemp("alone"))


def test_two_processes_give_the_same_bytes(alone, tmp_path, monkeypatch):
    monkeypatch.setenv("PEDPRED_JOBS", "2")
    assert len(alone) == 12  # three scenes of four files
    assert simulated_into(tmp_path) == alone


def test_results_come_in_the_order_of_the_tasks(monkeypatch):
    """Their job is none of this module, which workers would import for seconds."""
    monkeypatch.setenv("PEDPRED_JOBS", "2")
    tasks = [("sleep 0.3; echo slow",), ("echo fast",), ("echo last",)]
    assert in_parallel(subprocess.getoutput, tasks, "wait", "task") == ["slow", "fast", "last"]


def test_a_dask_cluster_gives_the_same_bytes(alone, tmp_path, monkeypatch):
    monkeypatch.setenv("PEDPRED_BACKEND", "dask")
    how = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    with (
        LocalCluster(**how) as cluster,
        dask.config.set({"scheduler-address": cluster.scheduler_address}),  # as $DASK_SCHEDULER_ADDRESS does
    ):
        assert simulated_into(tmp_path) == alone
        assert sum(worker.state.executed_count for worker in cluster.workers.values()) >= 3


def subclasses(kind):
    return [kind, *(found for below in kind.__subclasses__() for found in subclasses(below))]


@pytest.mark.parametrize("kind", subclasses(errors.PedpredError))
def test_an_error_crosses_the_border_of_a_process(kind):
    arguments = {"path": Path("a.txt"), "tried": {"b": "it is empty"}}
    arguments |= {"drives": DriveSettings(), "refused": Counter({"nobody comes near": 2})}
    names = list(inspect.signature(kind).parameters) if kind is not errors.PedpredError else []
    error = kind(*(arguments.get(name, name) for name in names))
    other = pickle.loads(pickle.dumps(error))  # noqa: S301
    assert (type(other), str(other), vars(other)) == (kind, str(error), vars(error))


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        *(("PEDPRED_JOBS", jobs) for jobs in ("0", "abc", "1e9", "100000")),
        ("PEDPRED_BACKEND", "abacus"),
        *(("DASK_SCHEDULER_ADDRESS", address) for address in ("tcp://127.0.0.1:9", "abacus://1:1")),
    ],
)
def test_setting_of_the_environment_is_refused_by_its_name(variable, value, monkeypatch):
    if variable == "DASK_SCHEDULER_ADDRESS":
        monkeypatch.setenv("PEDPRED_BACKEND", "dask")
    monkeypatch.setenv(variable, value)
    quick = {"scheduler-address": value, "distributed.comm.timeouts.connect": "100ms"}
    with dask.config.set(quick), refused(f"${variable}"):
        in_parallel(print, [()], "nothing", "task")
