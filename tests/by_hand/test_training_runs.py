"""Several processes and several runs by hand: weighted gradients, mean weights, and where a run begins."""

import hashlib
import math
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest
import torch
from torch import nn

from pedpred.errors import ValueRuleError
from pedpred.models.contract import Loss
from pedpred.training import fit as fitting
from pedpred.training.distributed import (
    ALONE,
    DeviceSettings,
    DistributedContext,
    distributed_context,
    multiplies_bfloat16,
)
from pedpred.training.fit import fit, initialise, load_training_rows, write_curve
from pedpred.training.learner import FitSettings
from pedpred.training.loop import Learner
from tests.by_hand.rows import FIT, STEPS, data_of
from tests.exported import NETWORK, lstm, write_autoencoder, write_network
from tests.refused import refused

TINY = lstm(2, 3, {"state": (2, 2)})


def test_joint_gradients_are_weighted_by_targets(monkeypatch):
    """Processes with 3 and 5 targets: (3 g + 5 g') / 8, and the same of the losses 1.5 and 0.9."""
    ours = np.array([1.0, -2.0, 0.5, 4.0, 3.0, 6.0, 8.0])
    theirs = np.array([2.0, 7.0, -1.0, 0.0, 9.0, 1.0, 3.0])

    def joined(our_weight, their_weight):
        def adding(values):
            assert values.tolist() == pytest.approx([*(our_weight * ours), 1.5 * our_weight, our_weight])
            values += torch.tensor([*(their_weight * theirs), 0.9 * their_weight, their_weight])

        monkeypatch.setattr(torch.distributed, "all_reduce", adding)
        shapes = ((2, 2), (2,), (1,))
        weights = [nn.Parameter(torch.zeros(shape)) for shape in shapes]
        for one, gradient in zip(weights, np.split(ours, [4, 6]), strict=True):
            one.grad = torch.tensor(gradient, dtype=torch.float32).view(one.shape)
        unused = nn.Parameter(torch.zeros(7))
        pair = DistributedContext(torch.device("cpu"), rank=1, size=2)
        loss = pair.average(iter([*weights, unused]), torch.tensor(1.5), torch.tensor(our_weight))
        assert unused.grad is None
        assert [one.grad.shape for one in weights] == list(shapes)
        return float(loss), torch.cat([one.grad.flatten() for one in weights]).numpy()

    loss, gradients = joined(3, 5)
    assert loss == pytest.approx((3 * 1.5 + 5 * 0.9) / 8)
    np.testing.assert_allclose(gradients, (3 * ours + 5 * theirs) / 8, rtol=1e-6)
    loss, gradients = joined(0, 1)
    assert loss == pytest.approx(0.9)
    np.testing.assert_allclose(gradients, theirs)
    loss, gradients = joined(0, 0)
    assert loss == 0.0
    assert not gradients.any()


def test_products_are_narrow_where_that_is_chosen():
    """256 + 1 is 257 in single precision; bfloat16 has even numbers alone there."""
    row, column = torch.tensor([[256.0, 1.0]]), torch.tensor([[1.0], [1.0]])
    for narrow in (False, True):
        with DistributedContext(torch.device("cpu"), narrow).precision():
            assert (float(row @ column) == 257.0) != narrow


@pytest.mark.parametrize(
    ("there", "device", "size", "chosen", "group"),
    [
        (False, "auto", 1, "cpu", None),
        (False, "auto", 2, "cpu", "gloo"),
        (True, "cpu", 2, "cpu", "gloo"),
        (True, "auto", 1, "cuda:1", None),
        (True, "cuda", 3, "cuda:1", "nccl"),
    ],
)
def test_a_process_has_its_device_and_its_group(monkeypatch, there, device, size, chosen, group):
    calls = []
    monkeypatch.setattr(torch.cuda, "is_available", lambda: there)
    monkeypatch.setattr(torch.cuda, "set_device", lambda at: calls.append(str(at)))
    monkeypatch.setattr(torch.distributed, "init_process_group", calls.append)
    monkeypatch.setattr(torch.distributed, "destroy_process_group", lambda: calls.append("end"))
    for name, value in {"RANK": size - 1, "WORLD_SIZE": size, "LOCAL_RANK": 1}.items():
        monkeypatch.setenv(name, str(value))
    with suppress(KeyError), distributed_context(device, True) as here:
        assert here == DistributedContext(torch.device(chosen), True, size - 1, size)
        begun = [call for call in (chosen if chosen != "cpu" else None, group) if call]
        assert calls == begun
        raise KeyError  # the group ends then, too
    assert calls == [*begun, *(["end"] if group else [])]


def test_one_process_is_alone(monkeypatch):
    for name in ("RANK", "WORLD_SIZE", "LOCAL_RANK"):
        monkeypatch.delenv(name, raising=False)
    with distributed_context("cpu", False) as here:
        assert here == ALONE
    for wrong in ({"device": "tpu"}, {"autocast": "fast"}, {"autocast": 1}, {"threads": 0}):
        right = {"threads": 1, "device": "auto", "autocast": "auto"}
        DeviceSettings(**right)
        with refused(next(iter(wrong))):
            DeviceSettings(**right | wrong)
    for wrong in (("tpu", False), ("cpu", "fast")):
        with pytest.raises(ValueRuleError), distributed_context(*wrong):
            pass


@pytest.mark.parametrize(
    ("units", "narrow"),
    [
        ({}, False),
        ({"avx512_f": True, "amx_bf16": False}, False),
        ({"amx_bf16": True, "avx512_bf16": False}, True),
        ({"avx512_bf16": True}, True),
    ],
)
def test_processors_multiply_bfloat16_with_any_unit_for_it(monkeypatch, units, narrow):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: units, raising=False)
    monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda including_emulation: including_emulation)
    assert multiplies_bfloat16(torch.device("cpu")) == narrow
    assert not multiplies_bfloat16(torch.device("cuda"))  # emulated products are slow
    for choice, expected in (("auto", narrow), (True, True), (False, False)):
        with distributed_context("cpu", choice) as here:
            assert here.autocast == expected


def test_the_state_of_all_lanes_is_that_of_each_process_in_order(monkeypatch):
    def gathering(parts, ours):
        for rank, part in enumerate(parts):
            part.copy_(ours + 10 * (rank - 1))

    monkeypatch.setattr(torch.distributed, "all_gather", gathering)
    second = DistributedContext(torch.device("cpu"), rank=1, size=3)
    whole = second.gather_state({"h": torch.tensor([[11.0], [12.0]])})
    assert whole["h"].flatten().tolist() == [1.0, 2.0, 11.0, 12.0, 21.0, 22.0]
    assert second.own_state(whole)["h"].flatten().tolist() == [11.0, 12.0]
    assert ALONE.gather_state(whole) is whole
    assert [DistributedContext(ALONE.device, rank=rank).writes for rank in (0, 1)] == [True, False]


@dataclass(frozen=True, kw_only=True)
class Falling(FitSettings):
    """A training that lowers every weight by the square of the seed."""

    def sampler(self, rows, context):
        raise NotImplementedError

    def learner(self, network, rows, context):
        return FallingLearner(network, self)


class FallingLearner(Learner):
    def __init__(self, network, settings):
        self.network, self.settings, self.memory = network, settings, {}
        self.optimizer = torch.optim.SGD(network.parameters(), lr=1.0)

    def batches(self, done):
        return iter(range(done, 10))

    def loss(self, batch, step):
        total = sum(weights.sum() for weights in self.network.parameters()) * self.settings.seed**2
        return Loss(total, torch.tensor(float(self.settings.seed**2)), torch.ones(()))

    def validate(self):
        return {"validation_seed": 10.0 * self.settings.seed**2}


@pytest.mark.parametrize(("runs", "fallen"), [(1, 16.0), (2, (16 + 25) / 2), (3, (16 + 25 + 36) / 3)])
def test_several_runs_are_averaged_weight_by_weight(tmp_path, monkeypatch, capsys, runs, fallen):
    """Seeds 4, 5, 6 lower the weights by 16, 25 and 36, times the rate 0.5."""
    monkeypatch.chdir(tmp_path)
    data = data_of()
    how = Falling(**FIT | {"steps": 1, "lr": 0.5, "warmup_steps": 0, "seed": 4}, runs=runs)
    start = initialise(TINY, data, None, 1)
    write_network(tmp_path / "start", start)
    found, curve, about = fit(TINY, tmp_path / "start", data, how, "toy", ALONE)
    said = capsys.readouterr().err
    assert "toy" in said
    assert ["seed 4" in said, "seed 5" in said] == [runs > 1] * 2
    for weights, before in zip(found.parameters(), start.parameters(), strict=True):
        torch.testing.assert_close(weights, before - 0.5 * fallen)
    assert curve["train_loss"].tolist()[1:] == pytest.approx([fallen])
    assert curve["validation_seed"].tolist() == pytest.approx([10 * fallen] * 2)
    assert curve["step"].tolist() == [0, 1]
    assert curve["step"].dtype == np.int64
    digest = hashlib.sha256(data.future.numpy().tobytes() + data.future_steps.numpy().tobytes())
    assert about["targets_sha256"] == digest.hexdigest()
    assert about["training"]["seed"] == 4
    assert about["widths"] == {"state": 2}
    assert not any((tmp_path / "build/training").glob("*"))


def test_one_run_starts_from_its_seed_or_from_given_weights(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data, how = data_of(), Falling(**FIT | {"steps": 1, "lr": 0.5, "warmup_steps": 0, "seed": 3})
    found, curve, _ = fit(TINY, None, data, how, "toy", ALONE)
    torch.manual_seed(3)
    for weights, before in zip(found.parameters(), TINY.build({"state": 2}, STEPS).parameters(), strict=True):
        torch.testing.assert_close(weights, before - 0.5 * 9)
    assert curve["train_loss"].tolist()[1:] == [9.0]
    with refused("runs"):
        fit(TINY, None, data, replace(how, runs=2), "toy", ALONE)


def test_a_network_takes_what_fits_of_the_phase_before(tmp_path):
    data = data_of(grid=torch.zeros(20, 392))
    encoder = write_autoencoder(tmp_path / "encoder").encoder
    found, fresh = (initialise(NETWORK, data, before, 7) for before in (tmp_path / "encoder", None))
    torch.manual_seed(7)
    expected = NETWORK.build(data.widths, STEPS)
    for name, weights in expected.state_dict().items():
        assert torch.equal(fresh.state_dict()[name], weights)
    expected.take_encoder(encoder)
    changed = 0
    for name, weights in expected.state_dict().items():
        assert torch.equal(found.state_dict()[name], weights)
        changed += not torch.equal(weights, fresh.state_dict()[name])
    assert changed > 0


def test_rows_beyond_a_track_have_the_code_of_free_ground(tmp_path, monkeypatch):
    encoder, asked = write_autoencoder(tmp_path).encoder, []
    data = data_of(grid=torch.zeros(20, 392))
    monkeypatch.setattr(fitting, "load_rows", lambda *given: asked.append(given) or data)
    folders, codes = {"a": tmp_path / "rows"}, {"a": tmp_path / "codes"}
    assert load_training_rows(TINY, folders, codes, tmp_path / "none") is data
    rows = load_training_rows(NETWORK, folders, codes, tmp_path)
    assert asked == [(folders,), (folders, codes)]
    free = encoder.embedding(torch.zeros(1, 60, 60))[0]
    torch.testing.assert_close(rows.empty["grid"], free.detach())


def test_a_curve_on_disk_has_five_decimals(tmp_path):
    write_curve(pd.DataFrame({"epoch": [0, 1], "train_loss": [math.nan, 2 / 3]}), tmp_path / "curve.tsv")
    assert (tmp_path / "curve.tsv").read_text() == "epoch\ttrain_loss\n0\t\n1\t0.66667\n"
