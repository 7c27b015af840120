"""The one training loop: steps, learning rate, periodic validation, best weights, curve."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from tqdm import tqdm

from pedpred.errors import ValueRuleError
from pedpred.models.contract import Loss, Tensors
from pedpred.training.distributed import ALONE, DistributedContext
from pedpred.training.progress import Progress, load_progress, save_progress
from pedpred.training.schedule import Schedule, learning_rate


class Learner(ABC):
    """What one kind of training gives the loop.

    Attributes:
        network: initialised, on its device.
        optimizer: of its weights.
        settings: see `Schedule`.
        context: of this process; every process of a training has the same learner but its own context.
        memory: recurrent state that is carried from step to step; saved with the progress. [N, ...] each
        best_by: validation figure, lower is better, that chooses the weights; None keeps the last weights.
    """

    network: nn.Module
    optimizer: torch.optim.Optimizer
    settings: Schedule
    memory: Tensors
    context: DistributedContext = ALONE
    best_by: str | None = None

    @abstractmethod
    def batches(self, done: int) -> Iterator[Any]:
        """An endless stream of batches, without those of the steps that are done."""

    @abstractmethod
    def loss(self, batch: Any, step: int) -> Loss:
        """Forward pass of a batch; carries `memory` on."""

    @abstractmethod
    def validate(self) -> dict[str, float]:
        """Figures of the validation data; the network is in evaluation mode."""

    def clip(self) -> None:  # noqa: B027, optional
        """Clip gradients; not at all by default."""


def train(learner: Learner, scratch: Path | None, description: str) -> list[dict[str, float]]:
    """Train a network; leaves the best validated weights in it, or the last ones without `best_by`.

    Args:
        learner: see `Learner`.
        scratch: folder for the state of an unfinished training, which is resumed if there is one; None
            keeps no state.
        description: title of the progress bar.

    Returns:
        The curve, one row per validation: epoch (index of the validation, from 0; not a pass over the data),
        step, train_loss, and the figures of the validation.

    Raises:
        ValueRuleError: the figure that chooses the weights cannot be computed, or the training diverges.
    """
    schedule = learner.settings
    progress = load_progress(scratch, learner)
    if progress is None:
        progress = Progress()
        _validate(learner, progress, float("nan"))
        if learner.best_by and not progress.best:
            rule = "the validation data have no step with a known horizon, or the weights are not finite"
            raise ValueRuleError(learner.best_by, progress.curve[0][learner.best_by], rule)
    batches = learner.batches(progress.step)
    losses: list[Tensor] = []
    bar = tqdm(
        total=schedule.steps,
        initial=progress.step,
        desc=description,
        unit="step",
        disable=not learner.context.writes,
    )
    while progress.step < schedule.steps:
        losses.append(train_step(learner, next(batches), progress.step))
        progress.step += 1
        bar.update()
        if progress.step % schedule.validate_every == 0 or progress.step == schedule.steps:
            train_loss = float(torch.stack(losses).double().mean())  # the only wait for a GPU
            bar.set_postfix_str(_validate(learner, progress, train_loss))
            _check_finite(schedule, progress)
            losses = []
            save_progress(scratch, progress, learner)
    bar.close()
    if learner.best_by:
        learner.network.load_state_dict(progress.best)
    return progress.curve


def _check_finite(schedule: Schedule, progress: Progress) -> None:
    """Check that the loss is finite, and every figure of the validation that was before the first step.

    Raises:
        ValueRuleError: it is not.
    """
    first, now = progress.curve[0], progress.curve[-1]
    finite = {"train_loss", *(name for name, value in first.items() if math.isfinite(value))}
    lost = [name for name in finite if not math.isfinite(now[name])]
    if lost:
        rule = f"{min(lost)} is not finite after {progress.step} steps: it diverges, use a lower one"
        raise ValueRuleError("lr", schedule.lr, rule)


def train_step(learner: Learner, batch: Any, step: int) -> Tensor:
    """Forward, backward and update with one batch; returns the joint reported loss. []."""
    schedule = learner.settings
    for group in learner.optimizer.param_groups:
        group["lr"] = learning_rate(step, schedule.steps, schedule.lr, schedule.warmup_steps)
    loss = learner.loss(batch, step)
    learner.optimizer.zero_grad(set_to_none=True)
    loss.total.backward()
    joint = learner.context.average(learner.network.parameters(), loss.reported.detach(), loss.weight)
    learner.clip()
    learner.optimizer.step()
    return joint


def _validate(learner: Learner, progress: Progress, train_loss: float) -> str:
    """Add a row to the curve and keep the weights if they are the best so far; returns the first figure."""
    learner.network.eval()
    figures = learner.validate()
    learner.network.train()
    if learner.best_by and figures[learner.best_by] < progress.lowest(learner.best_by):
        progress.best = {k: v.clone() for k, v in learner.network.state_dict().items()}
    row = {"epoch": len(progress.curve), "step": progress.step, "train_loss": train_loss}
    progress.curve.append(row | figures)
    return "".join(f"{name} {value:.3f}" for name, value in list(figures.items())[:1])
