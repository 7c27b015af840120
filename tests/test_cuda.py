"""Training on a CUDA device learns what training on the CPU does. These tests need such a device."""

import numpy as np
import pytest
import torch

from pedpred.datasets.rows import load_rows
from pedpred.training import train
from pedpred.training.distributed import ALONE, DistributedContext, distributed_context
from tests.exported import lstm, train_on, widths_of
from tests.trainings import INSTANTS, MIXTURE, SIZES, STEPS, VARIED, WIDTHS, toy_data, write_situations

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")

CUDA = DistributedContext(torch.device("cuda", 0))


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    return write_situations(tmp_path_factory.mktemp("situations"))


def of_sequences(here):
    """A learner of tracks whose network drops no units: random numbers of two devices differ."""
    torch.manual_seed(0)
    data = toy_data(np.random.default_rng(2)).to(here.device)
    network = lstm(16, 16, {"state": (8, 8), "angular": (8, 8)}).build(WIDTHS, 4).to(here.device)
    rows = data.spans.rows
    return train_on(network, data, rows[:4], rows[4:], VARIED, here)


def of_instants(here, folders):
    torch.manual_seed(0)
    network = MIXTURE.build(widths_of(SIZES), STEPS).to(here.device)
    return INSTANTS.learner(network, load_rows(folders).to(here.device), here)


@pytest.fixture(params=["sequences", "instants"])
def learner(request, folders):
    """How to make a learner: (context) -> Learner."""
    return of_sequences if request.param == "sequences" else lambda here: of_instants(here, folders)


def test_loss_gradients_and_curve_are_those_of_the_cpu(learner):
    cpu, cuda = learner(ALONE), learner(CUDA)
    first = [made.loss(next(made.batches(0)), 0) for made in (cpu, cuda)]
    for loss in first:
        loss.total.backward()
    assert first[1].reported.item() == pytest.approx(first[0].reported.item(), rel=1e-5)
    there = dict(cuda.network.named_parameters())
    for name, weights in cpu.network.named_parameters():
        largest = float(weights.grad.abs().max())
        torch.testing.assert_close(
            there[name].grad.cpu(), weights.grad, rtol=0, atol=2e-3 * largest + 1e-7, msg=name
        )
    for mine, other in zip(train(learner(ALONE), None, ""), train(learner(CUDA), None, ""), strict=True):
        assert other == pytest.approx(mine, rel=1e-3, nan_ok=True)
    assert {weights.device for weights in there.values()} == {CUDA.device}


@pytest.mark.parametrize(("first", "then"), [(CUDA, CUDA), (ALONE, CUDA), (CUDA, ALONE)])
def test_an_interrupted_training_continues_on_either_device(learner, tmp_path, first, then):
    whole, interrupted, resumed = learner(ALONE), learner(first), learner(then)
    curve = train(whole, None, "")
    batches = interrupted.batches
    interrupted.batches = lambda done: (batch for batch, _ in zip(batches(done), range(4), strict=False))
    with pytest.raises(StopIteration):
        train(interrupted, tmp_path, "")
    again = train(resumed, tmp_path, "")
    assert [row["step"] for row in again] == [row["step"] for row in curve]
    assert again[-1] == pytest.approx(curve[-1], rel=1e-3)


def test_a_training_on_cuda_gives_the_same_bytes_again(learner):
    one, two = learner(CUDA), learner(CUDA)
    assert train(one, None, "")[1:] == train(two, None, "")[1:]
    for name, weights in one.network.state_dict().items():
        assert torch.equal(two.network.state_dict()[name], weights), name


def test_narrow_products_change_a_loss_by_their_rounding_only(learner):
    made = learner(CUDA)
    train(made, None, "")  # an untrained network of instants continues the motion, exactly
    losses = []
    for narrow in (False, True):
        made.context = DistributedContext(CUDA.device, narrow)
        losses.append(made.loss(next(made.batches(0)), 0).reported.item())
    assert losses[0] != losses[1]
    assert losses[1] == pytest.approx(losses[0], rel=2e-2)


def test_a_device_is_chosen_where_there_is_one():
    with distributed_context("auto", "auto") as here:
        assert here.device == CUDA.device
        assert here.autocast is torch.cuda.is_bf16_supported(including_emulation=False)
    with distributed_context("cpu", False) as here:
        assert here == ALONE
