"""The training loop by hand: learning rates, updates, which weights are kept, and what a resumed run has."""

import json
import math

import numpy as np
import pytest
import torch
from torch import nn
from torch.nn.utils import clip_grad_norm_

from pedpred.errors import ValueRuleError
from pedpred.models.contract import Loss
from pedpred.training.distributed import ALONE, DistributedContext
from pedpred.training.loop import Learner, train, train_step
from pedpred.training.progress import Progress, load_progress, save_progress, scratch_folder
from pedpred.training.schedule import Schedule, learning_rate
from tests.refused import refused

HOW = Schedule(steps=7, validate_every=3, lr=0.5, warmup_steps=2, seed=0)
RATES = (0.25, 0.5, 0.5, 0.4527317, 0.3289817, 0.1760183, 0.0522683)
"""Of the steps of `HOW`: 0.5 (s + 1) / 2, then 0.5 (0.01 + 0.99 (1 + cos(pi (s - 2) / 5)) / 2)."""
GRADIENTS = ((1.0, 0.0), (0.0, 1.0), (2.0, -1.0), (0.5, 0.5), (1.0, 3.0), (-1.0, 2.0), (4.0, 1.0))
LOSSES = (1.0, 2.0, 9.0, 8.0, 3.0, 1.0, 6.0)
START = (2.0, -3.0)


class Slopes(Learner):
    """Two weights w. A batch is the number of a step; its loss is g w, with the gradient g of the step."""

    def __init__(self, figures, optimizer=torch.optim.SGD, settings=HOW, **how):
        self.network = nn.Linear(2, 1, bias=False)
        self.network.weight.data = torch.tensor([START])
        self.optimizer = optimizer(self.network.parameters(), lr=99.0)  # the schedule replaces it
        self.settings, self.memory = settings, {"seen": torch.zeros(1, 1)}
        self.figures, self.validated, self.done = iter(figures), [], None
        self.context, self.best_by = how.get("context", ALONE), how.get("best_by")
        self.clip_norm = how.get("clip_norm", math.inf)

    @property
    def weights(self):
        return tuple(self.network.weight.detach().double().flatten().tolist())

    def batches(self, done):
        self.done = done
        return iter(range(done, len(GRADIENTS)))

    def loss(self, batch, step):
        assert self.network.training
        self.memory = {"seen": self.memory["seen"] + batch + 1}
        total = (self.network.weight * torch.tensor(GRADIENTS[batch])).sum()
        return Loss(total, torch.tensor(LOSSES[batch]), torch.tensor(3.0 + batch))

    def validate(self):
        self.validated.append(self.network.training)
        return {"validation_other": 7.0, "validation_figure": next(self.figures)}

    def clip(self):
        clip_grad_norm_(self.network.parameters(), self.clip_norm)


def weights_after(steps):
    """w - sum of rate times gradient over the steps."""
    return np.array(START) - np.array(RATES[:steps]) @ np.array(GRADIENTS[:steps]).reshape(-1, 2)


@pytest.mark.parametrize(
    ("step", "rate"),
    [
        (0, 0.075),  # a quarter of the peak
        (2, 0.225),
        (3, 0.3),
        (4, 0.3),  # begin of the cosine
        (5, 0.280104),  # 0.3 (0.01 + 0.99 (1 + cos 30 deg) / 2)
        (7, 0.1515),  # half way between 0.3 and 0.003
        (9, 0.022896),
        (10, 0.003),
        (12, 0.003),
    ],
)
def test_rates_rise_linearly_and_fall_by_half_a_cosine(step, rate):
    assert learning_rate(step, 10, 0.3, 4) == pytest.approx(rate, abs=1e-6)


def test_rates_at_the_limits():
    assert learning_rate(0, 8, 0.3, 0) == 0.3  # no warm-up
    assert learning_rate(2, 8, 0.3, 0, 0.2) == pytest.approx(0.3 * (0.2 + 0.8 * 0.8535534))
    assert learning_rate(8, 8, 0.3, 0, 0.2) == pytest.approx(0.06)
    assert learning_rate(2, 3, 0.3, 5) == pytest.approx(0.18)  # the training ends before the warm-up
    assert [learning_rate(step, 5, 0.3, 5) for step in (4, 5)] == pytest.approx([0.3, 0.3])
    assert learning_rate(6, 5, 0.3, 5) == pytest.approx(0.003)


def test_weights_without_a_part_in_a_step_do_not_move():
    learner, other = Slopes([], torch.optim.AdamW), nn.Parameter(torch.ones(1))
    learner.optimizer.add_param_group({"params": [other]})
    gradients = learner.loss
    learner.loss = lambda batch, step: gradients(batch, step)._replace(total=3 * other.sum())
    train_step(learner, 0, 0)
    once = other.item()
    learner.loss = gradients
    train_step(learner, 1, 1)
    assert other.item() == once != 1.0


def test_all_groups_of_weights_have_the_same_rate():
    learner = Slopes([])
    learner.optimizer.add_param_group({"params": [nn.Parameter(torch.ones(1))], "lr": 3.0})
    train_step(learner, 0, 0)
    assert [group["lr"] for group in learner.optimizer.param_groups] == [0.25, 0.25]


def test_the_joint_gradient_is_clipped_and_not_ours():
    """The joint gradient is (12, 16), of norm 20, clipped to (0.6, 0.8); ours is (4, 1)."""
    seen = []

    class Joint(DistributedContext):
        def average(self, parameters, loss, weight):
            seen.append((float(loss), float(weight)))
            next(iter(parameters)).grad.copy_(torch.tensor([[12.0, 16.0]]))
            return torch.tensor(77.0)

    learner = Slopes([], context=Joint(torch.device("cpu")), clip_norm=1.0)
    assert float(train_step(learner, 6, 1)) == 77.0
    assert seen == [(6.0, 9.0)]  # the reported loss and its number of targets
    assert learner.weights == pytest.approx((2.0 - 0.5 * 0.6, -3.0 - 0.5 * 0.8), abs=1e-5)


def test_the_curve_has_the_mean_loss_since_the_last_validation():
    learner = Slopes([5.0, 4.0, 6.0, 3.0])
    curve = train(learner, None, "toy")
    assert [row["step"] for row in curve] == [0, 3, 6, 7]
    assert [row["epoch"] for row in curve] == [0, 1, 2, 3]
    assert [row["validation_figure"] for row in curve] == [5.0, 4.0, 6.0, 3.0]
    assert [row["validation_other"] for row in curve] == [7.0] * 4
    assert math.isnan(curve[0]["train_loss"])
    # (1 + 2 + 9) / 3, (8 + 3 + 1) / 3, and the last step alone
    assert [row["train_loss"] for row in curve[1:]] == pytest.approx([4.0, 4.0, 6.0])
    assert learner.validated == [False] * 4
    assert learner.network.training


@pytest.mark.parametrize(
    ("figures", "best"),
    [
        ((5.0, 3.0, 4.0, 6.0), 3),
        ((5.0, 3.0, 3.0, 3.0), 3),  # only a strictly lower figure replaces the first one
        ((5.0, 6.0, 4.0, 4.5), 6),
        ((5.0, 6.0, 4.0, 3.0), 7),
        ((3.0, 4.0, 5.0, 3.0), 0),  # no step made it better
        ((5.0, -2.0, -3.0, 1.0), 6),
    ],
)
def test_the_weights_of_the_lowest_figure_are_put_back(figures, best):
    learner = Slopes(figures, best_by="validation_figure")
    train(learner, None, "toy")
    assert learner.weights == pytest.approx(weights_after(best), abs=1e-5)


def test_a_figure_that_is_lost_ends_the_training():
    curve = train(Slopes([math.nan, math.nan, 2.0, math.nan]), None, "toy")
    assert len(curve) == 4
    for figures in ([1.0, math.nan, 1.0, 1.0], [1.0, 2.0, math.inf, 1.0]):
        with refused("lr"):
            train(Slopes(figures), None, "toy")
    with refused("validation_figure"):
        train(Slopes([math.nan], best_by="validation_figure"), None, "toy")


@pytest.mark.parametrize("ended_at", [3, 6])
def test_a_resumed_training_has_what_an_undisturbed_one_has(tmp_path, ended_at):
    figures = (5.0, 3.0, 4.0, 6.0)
    by = {"optimizer": torch.optim.AdamW, "best_by": "validation_figure"}
    whole, broken = Slopes(figures, **by), Slopes(figures[: ended_at // 3 + 1], **by)
    curve = train(whole, None, "toy")
    with pytest.raises(StopIteration):
        train(broken, tmp_path, "toy")
    again = Slopes(figures[ended_at // 3 + 1 :], **by)
    assert train(again, tmp_path, "toy")[1:] == curve[1:]
    assert again.done == ended_at
    assert again.weights == whole.weights
    assert again.memory == whole.memory == {"seen": torch.tensor([[28.0]])}  # 1 + 2 + ... + 7


def test_progress_on_disk_is_everything_to_the_last_bit(tmp_path):
    one, other = (Slopes([], torch.optim.AdamW) for _ in range(2))
    for step in range(3):
        train_step(one, step, step)
    curve = [{"step": 0, "train_loss": math.nan}, {"step": 3, "train_loss": 0.1 + 0.2}]
    save_progress(tmp_path, Progress(3, {"weight": torch.tensor([[7.5, 8.5]])}, curve), one)
    found = load_progress(tmp_path, other)
    assert found.step == 3
    assert found.best["weight"].tolist() == [[7.5, 8.5]]
    assert json.dumps(found.curve) == json.dumps(curve)
    assert other.weights == one.weights
    assert other.memory == {"seen": torch.tensor([[6.0]])}
    for step in range(3, 6):  # the moments of the optimiser, and its count of steps
        train_step(one, step, step)
        train_step(other, step, step)
        assert other.weights == one.weights


def test_nothing_is_kept_without_a_folder_or_by_a_second_process(tmp_path):
    learner, second = Slopes([]), Slopes([], context=DistributedContext(torch.device("cpu"), rank=1))
    save_progress(None, Progress(), learner)
    assert load_progress(None, learner) is None
    assert load_progress(tmp_path / "none", learner) is None
    save_progress(tmp_path / "second", Progress(), second)
    assert not (tmp_path / "second").exists()


def test_the_first_process_alone_shows_progress(capsys):
    for rank in (1, 0):
        train(Slopes([1.0] * 4, context=DistributedContext(torch.device("cpu"), rank=rank)), None, "toy")
        assert bool(capsys.readouterr().err) == (rank == 0)


def test_a_folder_belongs_to_settings_and_weights(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    second = DistributedContext(torch.device("cpu"), rank=1)

    def folder(about, weights=None, error=None, context=ALONE):
        with scratch_folder(about, weights, context) as found:
            found.mkdir(parents=True, exist_ok=True)
            if error:
                raise error
        return found

    first = folder({"a": 1, "b": 2}, {"w": torch.ones(2)})
    assert first == folder({"b": 2, "a": 1}, {"w": torch.ones(2)})
    assert not first.exists()
    others = [folder({"a": 1}, {"w": torch.ones(2)}), folder({"a": 1, "b": 2}), folder({"a": 1, "b": 3})]
    others.append(folder({"a": 1, "b": 2}, {"w": torch.tensor([1.0, 2.0])}))
    assert len({first, *others}) == 5
    with pytest.raises(ValueRuleError):
        folder({"a": 1}, None, ValueRuleError("lr", 1, "lower"))
    assert not any(first.parent.iterdir())
    with pytest.raises(ValueRuleError), scratch_folder({"a": 1}) as never_made:
        raise ValueRuleError("lr", 1, "lower")
    assert not never_made.exists()
    with pytest.raises(KeyboardInterrupt):
        folder({"a": 1}, None, KeyboardInterrupt())
    kept = list(first.parent.iterdir())
    assert len(kept) == 1  # an interrupted training goes on there
    assert folder({"a": 1}, context=second) == kept[0]
    assert kept[0].exists()  # the first process removes it
