"""The one recurrent training loop: corridor, main training and fine-tuning."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from torch.nn.utils import clip_grad_norm_
from tqdm import tqdm

from pedpred.datasets.lanes import LaneBatch, stream_lanes
from pedpred.datasets.motion import MotionData
from pedpred.models.motion import MotionLstm
from pedpred.models.rolling import displacements, roll
from pedpred.models.uncertainty import negative_log_density
from pedpred.training.loss import spread_loss, velocity_loss
from pedpred.training.progress import Progress, load_progress, save_progress
from pedpred.training.schedule import learning_rate
from pedpred.training.variation import varied


@dataclass(frozen=True)
class TrainingSettings:
    """How a motion network is trained.

    Attributes:
        steps: optimiser steps.
        lanes: tracks that are streamed side by side, B.
        sub_sequence: truncation depth L, steps.
        longest_track: tracks are cut into pieces of at most this many steps.
        validate_every: steps between two validations (and saved states).
        lr: peak learning rate.
        warmup_steps: steps of linear warm-up.
        clip_norm: largest gradient norm.
        weight_decay: decoupled weight decay (the paper's lambda).
        seed: of the order of the tracks, the split and dropout.
        strange_share: share of the tracks that are mirrored beside another lane's obstacles, see `varied`.
        pace_range: factor on a track's velocities, (least, most), see `varied`.
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
    strange_share: float = 0.0
    pace_range: tuple[float, float] = (1.0, 1.0)


def train_motion(
    network: MotionLstm,
    data: MotionData,
    training: np.ndarray,
    validation: np.ndarray,
    settings: TrainingSettings,
    scratch: Path,
    description: str,
) -> list[dict[str, float]]:
    """Train by truncated back-propagation through time; leaves the best validated weights in `network`.

    Args:
        network: initialised; the starting weights count as the first candidate.
        data: all rows.
        training: rows [first, last) of the sequences to learn from. [S, 2]
        validation: rows [first, last) of the sequences to choose the weights by. [S, 2]
        settings: see there.
        scratch: folder for the state of an unfinished training; where one lies, it is continued.
        description: title of the progress bar.

    Returns:
        The curve, one row per validation: epoch, step, train_loss (m/s), validation_ade_m, validation_nll.
    """
    optimizer = torch.optim.AdamW(network.parameters(), lr=settings.lr, weight_decay=settings.weight_decay)
    progress = load_progress(scratch, network, optimizer)
    if progress is None:
        progress = Progress(0, network.start(settings.lanes))
        _validate(network, data, validation, progress, float("nan"))
    batches = _batches(training, settings, progress.step)
    losses: list[float] = []
    bar = tqdm(total=settings.steps, initial=progress.step, desc=description, unit="step")
    while progress.step < settings.steps:
        losses.append(_step(network, data, next(batches), optimizer, progress, settings))
        bar.update()
        if progress.step % settings.validate_every == 0 or progress.step == settings.steps:
            ade_m = _validate(network, data, validation, progress, float(np.mean(losses)))
            bar.set_postfix_str(f"validation ADE {ade_m:.3f} m")
            losses = []
            save_progress(scratch, progress, network, optimizer)
    bar.close()
    network.load_state_dict(progress.best)
    return progress.curve


def _batches(training: np.ndarray, settings: TrainingSettings, done: int) -> Iterator[LaneBatch]:
    """The endless stream of lanes, from where a training of so many steps stands."""
    rng = np.random.default_rng(settings.seed)
    stream = stream_lanes(training, settings.lanes, settings.sub_sequence, settings.longest_track, rng)
    return islice(stream, done, None)


def _step(
    network: MotionLstm,
    data: MotionData,
    batch: LaneBatch,
    optimizer: torch.optim.Optimizer,
    progress: Progress,
    settings: TrainingSettings,
) -> float:
    """One sub-sequence of every lane: forward, backward, update; returns the loss, m/s."""
    torch.manual_seed(settings.seed + progress.step)  # dropout: the same after a resumption
    for group in optimizer.param_groups:
        group["lr"] = learning_rate(progress.step, settings.steps, settings.lr, settings.warmup_steps)
    rows = torch.from_numpy(batch.rows)
    inputs, future = varied(
        data.inputs(rows),
        data.future[rows.clamp(min=0)],
        torch.from_numpy(batch.chance),
        settings.strange_share,
        settings.pace_range,
    )
    state = progress.state.reset(
        torch.from_numpy(batch.starts)
    ).detached()  # the memory stays, the gradient ends
    motion, progress.state = network(inputs, state)
    known = data.known(rows)
    loss = velocity_loss(motion.velocities, future, known)
    optimizer.zero_grad(set_to_none=True)
    (loss + spread_loss(motion, future, known, data.dt_s)).backward()
    for weights in network.parts():  # one norm for both would let the spread slow the mean down
        clip_grad_norm_(weights, settings.clip_norm)
    optimizer.step()
    progress.step += 1
    return loss.item()


def _validate(
    network: MotionLstm, data: MotionData, sequences: np.ndarray, progress: Progress, train_loss: float
) -> float:
    """Add a row to the curve and keep the weights if they are the best so far; returns the error, m."""
    network.eval()
    found = validation(network, data, sequences)
    network.train()
    ade_m = found["validation_ade_m"]
    if ade_m < progress.best_ade_m:
        progress.best = {k: v.detach().clone() for k, v in network.state_dict().items()}
    row = {"epoch": len(progress.curve), "step": progress.step, "train_loss": train_loss}
    progress.curve.append(row | found)
    return ade_m


def validation(network: MotionLstm, data: MotionData, sequences: np.ndarray) -> dict[str, float]:
    """Average displacement error, m, and negative log likelihood, nats, where the whole horizon is known."""
    rows = torch.from_numpy(np.concatenate([np.arange(a, b) for a, b in sequences]))
    rows = rows[data.known(rows).all(dim=-1)]
    motion = roll(network, data, sequences)
    error = displacements(motion.velocities[rows], data.future[rows], data.dt_s)
    found = {"validation_ade_m": torch.linalg.vector_norm(error, dim=-1).mean().item()}
    if motion.spread is not None:
        found["validation_nll"] = negative_log_density(error, motion.spread[rows]).mean().item()
    return found
