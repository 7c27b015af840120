"""A narrow encoder learns to give the embeddings of the full one (distillation, Hinton et al. 2015).

Two thirds of a forecast's cost are the full encoder's convolutions. The narrow one puts numbers with the same
meaning in the same places, so every recurrent network works with it as it is, with no training of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from pedpred.datasets.crops import EmbeddedCrops
from pedpred.features import unpack_crops
from pedpred.networks import GridEncoder
from pedpred.training.schedule import learning_rate

_SEEN_AS = ("embedding", "latent")
_CROPS_AT_ONCE = 256


@dataclass(frozen=True)
class DistillationSettings:
    """How the narrow encoder is trained.

    Attributes:
        widths: channels behind its first and its second convolution.
        batch: crops per step.
        steps: optimiser steps.
        validate_every: steps between two validations.
        lr: peak learning rate (Adam).
        warmup_steps: steps of linear warm-up.
        seed: of the weights and of the order of the crops.
    """

    widths: tuple[int, int]
    batch: int
    steps: int
    validate_every: int
    lr: float
    warmup_steps: int
    seed: int


def distil(
    teacher: GridEncoder, training: EmbeddedCrops, validation: EmbeddedCrops, settings: DistillationSettings
) -> tuple[GridEncoder, list[dict[str, float]]]:
    """Train a narrow encoder.

    Args:
        teacher: pre-trained; its fully connected layer is taken over as it is.
        training: crops and the teacher's embeddings.
        validation: those of other arrangements.
        settings: see there.

    Returns:
        The encoder, and its curve: one row per validation.
    """
    torch.manual_seed(settings.seed)
    rng = np.random.default_rng(settings.seed)
    student = GridEncoder(teacher.fc.out_features, settings.widths)
    student.fc.load_state_dict(teacher.fc.state_dict())
    student.fc.requires_grad_(False)
    optimizer = torch.optim.Adam([p for p in student.parameters() if p.requires_grad], lr=settings.lr)
    curve: list[dict[str, float]] = [{"step": 0, "train_loss": float("nan")} | validate(student, validation)]
    losses: list[float] = []
    for step in tqdm(range(settings.steps), desc="narrow encoder", unit="step"):
        rows = np.sort(rng.integers(0, len(training), settings.batch))
        optimizer.param_groups[0]["lr"] = learning_rate(
            step, settings.steps, settings.lr, settings.warmup_steps
        )
        loss = torch.stack(list(unexplained(student, *batch(training, rows)).values())).sum()
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
        if (step + 1) % settings.validate_every == 0 or step + 1 == settings.steps:
            row = {"step": step + 1, "train_loss": float(np.mean(losses))}
            curve.append(row | validate(student, validation))
            losses = []
    return student, curve


def unexplained(student: GridEncoder, crops: Tensor, embeddings: Tensor) -> Mapping[str, Tensor]:
    """Share of the teacher's variance that a student misses, sum |c - c'|^2 / sum |c - mean c|^2.

    Of the embedding c, and of the latent features W c, which is what the recurrent network first makes of it.

    Args:
        student: with the teacher's fully connected layer W.
        crops: [N, cells, cells]
        embeddings: the teacher's. [N, C]
    """
    missed, spread = squares(student, crops, embeddings, embeddings.mean(dim=0))
    return dict(zip(_SEEN_AS, missed / spread, strict=True))


def squares(student: GridEncoder, crops: Tensor, embeddings: Tensor, mean: Tensor) -> Tensor:
    """What `unexplained` divides, [missed, spread] x [embedding, latent]: sum |c - c'|^2, |c - mean|^2."""
    parts = (student.embedding(crops) - embeddings, embeddings - mean)
    weight = student.fc.weight
    return torch.stack([torch.stack([p.square().sum(), (p @ weight.T).square().sum()]) for p in parts])


@torch.inference_mode()
def validate(student: GridEncoder, crops: EmbeddedCrops) -> dict[str, float]:
    """What a student misses of all crops, see `unexplained`, with some of them in memory at a time."""
    mean = torch.from_numpy(np.mean(crops.embedding, axis=0, dtype=np.float64).astype(np.float32))
    blocks = np.split(np.arange(len(crops)), range(_CROPS_AT_ONCE, len(crops), _CROPS_AT_ONCE))
    parts = torch.stack([squares(student, *batch(crops, rows), mean) for rows in blocks])
    missed, spread = parts.double().sum(dim=0)
    return {f"validation_{n}_missed": float(s) for n, s in zip(_SEEN_AS, missed / spread, strict=True)}


def batch(crops: EmbeddedCrops, rows: np.ndarray) -> tuple[Tensor, Tensor]:
    """Crops and embeddings of some rows. [B, cells, cells], [B, C] float32."""
    cells = unpack_crops(crops.packed[rows], crops.cells)
    return torch.from_numpy(cells).to(torch.float32), torch.from_numpy(crops.embedding[rows]).to(
        torch.float32
    )
