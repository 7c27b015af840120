"""The one recurrent training loop: corridor, main training and fine-tuning."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn.utils import clip_grad_norm_
from tqdm import tqdm

from pedpred.datasets.lanes import stream_lanes
from pedpred.datasets.motion import MotionData
from pedpred.networks.lstm import MotionLstm
from pedpred.training.distributed import ALONE, DistributedContext
from pedpred.training.loss import spread_loss, velocity_loss
from pedpred.training.progress import Progress, load_progress, save_progress
from pedpred.training.schedule import learning_rate
from pedpred.training.validation import validate
from pedpred.training.variation import Variation, VariedBatch, looked_up, varied

_APART = 1_000_003
"""Between the seeds of two processes, so that they do not drop the same units."""


@dataclass(frozen=True)
class TrainingSettings:
    """How a motion network is trained.

    Attributes:
        steps: optimiser steps.
        lanes: tracks that are streamed side by side, B; by all processes together.
        sub_sequence: truncation depth L, steps.
        longest_track: tracks are cut into pieces of at most this many steps.
        validate_every: steps between two validations (and saved states).
        lr: peak learning rate.
        warmup_steps: steps of linear warm-up.
        clip_norm: largest gradient norm.
        weight_decay: decoupled weight decay (the paper's lambda).
        seed: of the order of the tracks, the split and dropout.
        variation: how the tracks vary, see there.
    """

    steps: int
    lanes: int
    sub_sequence: int
    longest_track: int
    validate_every: int
    lr: float
    warmup_steps: int
    clip_norm: float
    weight_decay: float
    seed: int
    variation: Variation = field(default_factory=Variation)

    @classmethod
    def parse(cls, plain: Mapping) -> TrainingSettings:
        """Build from plain dictionaries (configuration)."""
        return cls(**{**plain, "variation": Variation(**plain["variation"])})


def train_motion(
    network: MotionLstm,
    data: MotionData,
    training: np.ndarray,
    validation: np.ndarray,
    settings: TrainingSettings,
    scratch: Path,
    description: str,
    context: DistributedContext = ALONE,
) -> list[dict[str, float]]:
    """Train by truncated back-propagation through time; leaves the best validated weights in `network`.

    Args:
        network: initialised, on the machine's device; the starting weights count as the first candidate.
        data: all rows, on the same device.
        training: rows [first, last) of the sequences to learn from. [S, 2]
        validation: rows [first, last) of the sequences to choose the weights by. [S, 2]
        settings: see there.
        scratch: folder for the state of an unfinished training; where one lies, it is continued.
        description: title of the progress bar.
        context: every process of a training calls this with the same arguments but its own machine.

    Returns:
        The curve, one row per validation: epoch, step, train_loss (m/s), validation_ade_m, validation_nll.
    """
    optimizer = adamw(network, settings)
    progress = load_progress(scratch, network, optimizer, context)
    if progress is None:
        lanes = context.share(settings.lanes)
        progress = Progress(0, network.start(lanes.stop - lanes.start))
        validate(network, data, validation, progress, float("nan"), context)
    batches = training_batches(training, settings, progress.step)
    losses: list[Tensor] = []
    bar = tqdm(
        total=settings.steps,
        initial=progress.step,
        desc=description,
        unit="step",
        disable=not context.writes,
    )
    while progress.step < settings.steps:
        batch = next(batches).part(context.share(settings.lanes), context.device)
        losses.append(training_step(network, data, batch, optimizer, progress, settings, context))
        bar.update()
        if progress.step % settings.validate_every == 0 or progress.step == settings.steps:
            train_loss = float(torch.stack(losses).double().mean())  # the only wait for a GPU
            ade_m = validate(network, data, validation, progress, train_loss, context)
            bar.set_postfix_str(f"validation ADE {ade_m:.3f} m")
            losses = []
            save_progress(scratch, progress, network, optimizer, context)
    bar.close()
    network.load_state_dict(progress.best)
    return progress.curve


def adamw(network: MotionLstm, settings: TrainingSettings) -> torch.optim.Optimizer:
    """Adam with decoupled weight decay; one pass over the weights instead of one per operation."""
    return torch.optim.AdamW(
        network.parameters(), lr=settings.lr, weight_decay=settings.weight_decay, fused=True
    )


def training_batches(training: np.ndarray, settings: TrainingSettings, done: int) -> Iterator[VariedBatch]:
    """The endless stream of lanes, from where a training of so many steps stands."""
    rng = np.random.default_rng(settings.seed)
    stream = stream_lanes(training, settings.lanes, settings.sub_sequence, settings.longest_track, rng)
    for step, batch in enumerate(islice(stream, done, None), done):
        yield varied(batch, settings.variation, np.random.default_rng([settings.seed, step]))


def training_step(
    network: MotionLstm,
    data: MotionData,
    batch: VariedBatch,
    optimizer: torch.optim.Optimizer,
    progress: Progress,
    settings: TrainingSettings,
    context: DistributedContext,
) -> Tensor:
    """One sub-sequence of every lane: forward, backward, update; returns the joint loss, m/s. []."""
    torch.manual_seed(settings.seed + progress.step + _APART * context.rank)  # dropout: same when resumed
    for group in optimizer.param_groups:
        group["lr"] = learning_rate(progress.step, settings.steps, settings.lr, settings.warmup_steps)
    inputs, future = looked_up(data, batch)
    known = data.known(batch.rows)
    state = progress.state.reset(batch.starts).detached()  # the memory stays, the gradient ends
    with context.precision():
        motion, progress.state = network(inputs, state)
    loss = velocity_loss(motion.velocities, future, known)
    optimizer.zero_grad(set_to_none=True)
    (loss + spread_loss(motion, future, known, data.dt_s)).backward()
    joint_loss = context.average(network.parameters(), loss.detach(), known.sum())
    for weights in network.parts():  # one norm for both would let the spread slow the mean down
        clip_grad_norm_(weights, settings.clip_norm)
    optimizer.step()
    progress.step += 1
    return joint_loss
