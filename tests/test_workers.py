"""Wherever the work is done, the results are the same bytes."""

import dataclasses
import hashlib
import inspect
import pickle
import subprocess
from collections import Counter
from pathlib import Path

import dask
import numpy as np
import pytest
from distributed import LocalCluster
from joblib import parallel_config

from pedpred import errors
from pedpred.driving.episodes import DriveSettings
from pedpred.features.perception import Perception
from pedpred.simulation.sensor import SensorSettings
from pedpred.storage.scenes import write_scene
from pedpred.tracking import KalmanSettings
from pedpred.workers import in_parallel
from stages.rows import scene_steps, write_file
from stages.simulate import simulate_into
from tests.exported import LSTM_ROWS
from tests.refused import refused
from tests.simulated import SETTINGS, short
from tests.worlds import walled_scene

FAULTS = SensorSettings(position_noise_m=0.05, drop_out_share=0.1, switch_share=0.1)
HOW = Perception(KalmanSettings(0.1, 0.1), 0.2, FAULTS)


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


def features_with(jobs, scenes, out, monkeypatch):
    monkeypatch.setenv("PEDPRED_JOBS", jobs)
    tasks = [
        (out, LSTM_ROWS, scene.name, scene_steps, scene, "", scene.name, HOW, LSTM_ROWS, 3)
        for scene in sorted(scenes.iterdir())
    ]
    in_parallel(write_file, tasks, "features", "room")
    return contents(out)


def test_features_are_the_same_bytes_too(tmp_path, monkeypatch):
    """Through a sensor with faults, whose noise is drawn."""
    for seed in range(3):
        scene = walled_scene(np.random.default_rng(seed), detections=12)
        write_scene(dataclasses.replace(scene, name=f"room{seed}"), tmp_path / f"scenes/room{seed}")
    one, two = (features_with(n, tmp_path / "scenes", tmp_path / n, monkeypatch) for n in ("1", "2"))
    assert len(one) == 3
    assert one == two


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


@pytest.mark.parametrize("jobs", ["0", "-3", "abc", "1e9", "100000"])
def test_a_wrong_number_of_jobs_is_refused(jobs, monkeypatch):
    monkeypatch.setenv("PEDPRED_JOBS", jobs)
    with refused("$PEDPRED_JOBS"):
        in_parallel(print, [()], "nothing", "task")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "abacus://1:1"])
def test_a_cluster_that_does_not_answer_is_named(address, monkeypatch):
    monkeypatch.setenv("PEDPRED_BACKEND", "dask")
    monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", address)
    quick = {"scheduler-address": address, "distributed.comm.timeouts.connect": "100ms"}
    with dask.config.set(quick), refused("$DASK_SCHEDULER_ADDRESS"):
        in_parallel(print, [()], "nothing", "task")


def test_an_unknown_backend_is_refused(monkeypatch):
    monkeypatch.setenv("PEDPRED_BACKEND", "abacus")
    with refused("$PEDPRED_BACKEND"):
        in_parallel(print, [()], "nothing", "task")
