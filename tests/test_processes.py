"""Training on several processes and devices: the same training as on one."""

import multiprocessing
import os
import socket
from itertools import islice

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from pedpred.training import train as train_learner
from pedpred.training.distributed import ALONE, DistributedContext, distributed_context
from pedpred.training.loop import train_step
from tests.exported import train_on
from tests.refused import refused
from tests.trainings import SMALL, VARIED, WIDTHS, toy_data


def train(here, folder):
    """Six steps on four lanes; the curve, with everything else left in `folder`."""
    torch.manual_seed(0)
    data = toy_data(np.random.default_rng(2))
    data.future_steps[::7] = 1  # so that the processes' shares weigh differently
    network = SMALL.build(WIDTHS, 4)
    learner = train_on(network, data, data.spans.rows[:4], data.spans.rows[4:], VARIED, here)
    return train_learner(learner, folder, "")


def one_of_two(rank, port, folder):
    torch.set_num_threads(1)
    place = {"RANK": rank, "WORLD_SIZE": 2, "LOCAL_RANK": rank}
    place |= {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": port}
    os.environ.update({name: str(value) for name, value in place.items()})
    with distributed_context("cpu", False) as here:
        curve = train(here, folder)
    torch.save(curve, folder / f"curve{rank}.pt")


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


def test_two_processes_learn_what_one_does_with_all_lanes(tmp_path):
    alone = train(ALONE, tmp_path / "alone")
    together = tmp_path / "together"
    together.mkdir()
    multiprocessing.set_forkserver_preload([__name__, "torch._dynamo"])  # imported once for both
    torch.multiprocessing.start_processes(
        one_of_two, (free_port(), together), nprocs=2, start_method="forkserver"
    )
    curves = [torch.load(together / f"curve{rank}.pt") for rank in range(2)]
    assert curves[0][1:] == curves[1][1:]  # [0] has no loss yet, and nan equals nothing
    for mine, joint in zip(alone, curves[0], strict=True):
        assert joint == pytest.approx(mine, rel=1e-5, nan_ok=True)
    states = [load_file(folder / "progress.safetensors") for folder in (tmp_path / "alone", together)]
    assert states[0].keys() == states[1].keys()
    for name, value in states[0].items():  # weights, the optimiser's moments, the memory of all lanes
        torch.testing.assert_close(states[1][name], value, rtol=1e-4, atol=1e-6, msg=name)


def test_lanes_are_divided_evenly_or_refused():
    shares = [DistributedContext(ALONE.device, rank=rank, size=4).share(64) for rank in range(4)]
    assert [i for share in shares for i in range(64)[share]] == list(range(64))
    with refused("lanes"):
        DistributedContext(ALONE.device, size=3).share(64)
    with refused("rows"):
        DistributedContext(ALONE.device, size=3).share(64, "rows")


def test_a_device_that_is_not_there_is_refused():
    for device in ["tpu", *([] if torch.cuda.is_available() else ["cuda"])]:
        with refused("device"), distributed_context(device, False):
            pass


def test_a_training_step_stays_on_its_device():
    """A step makes no tensor elsewhere and reads no value: on the device "meta", both would fail."""
    far = DistributedContext(torch.device("meta"))
    network, data = SMALL.build(WIDTHS, 4).to(far.device), toy_data(np.random.default_rng(0)).to(far.device)
    learner = train_on(network, data, data.spans.rows, data.spans.rows, VARIED, far)
    learner.optimizer = torch.optim.SGD(network.parameters())
    for step, batch in enumerate(islice(learner.batches(0), 2)):
        loss = train_step(learner, batch, step)
        assert loss.device.type == "meta"
