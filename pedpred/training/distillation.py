"""Train a narrow encoder to reproduce the embeddings of the full one (distillation, Hinton et al. 2015).

The full encoder's convolutions are two thirds of a forecast's cost. The narrow one approximates the same
embedding, so every recurrent network works with it without further training.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from pedpred.datasets.crops import EmbeddedCrops
from pedpred.errors import ValueRuleError
from pedpred.networks.autoencoder import GridEncoder
from pedpred.networks.contract import Loss
from pedpred.networks.encoding import float_crops
from pedpred.simulation.fields import check_ranges
from pedpred.training.pretraining import CropLearner
from pedpred.training.schedule import Schedule

_FIGURES = ("embedding", "latent")
_CROPS_AT_ONCE = 256


@dataclass(frozen=True, kw_only=True)
class DistillationSettings(Schedule):
    """How the narrow encoder is trained.

    Attributes:
        widths: channels behind its first and its second convolution.
        batch: crops per step.
    """

    widths: tuple[int, ...]
    batch: int

    def __post_init__(self) -> None:
        super().__post_init__()
        check_ranges(self, {"widths": "[1, 10000]", "batch": "[1, 1000000]"})
        if len(self.widths) != 2:
            raise ValueRuleError("widths", self.widths, "the encoder has two convolutions")


class DistillationLearner(CropLearner):
    """A narrow encoder, its teacher's fully connected layer, and crops with the teacher's embeddings."""

    network: GridEncoder

    def __init__(
        self,
        teacher: GridEncoder,
        training: EmbeddedCrops,
        validation: EmbeddedCrops,
        settings: DistillationSettings,
    ):
        """Make random weights.

        Args:
            teacher: pre-trained; its fully connected layer is copied unchanged.
            training: crops and the teacher's embeddings.
            validation: those of other arrangements.
            settings: see there.
        """
        torch.manual_seed(settings.seed)
        self.training, self.validation, self.settings = training, validation, settings
        first, second = settings.widths
        student = GridEncoder(training.cells, teacher.fc.out_features, (first, second))
        student.fc.load_state_dict(teacher.fc.state_dict())
        student.fc.requires_grad_(False)
        self.network = student
        self.optimizer = torch.optim.Adam([p for p in student.parameters() if p.requires_grad], settings.lr)
        self.count, self.memory = len(training), {}

    def loss(self, batch: np.ndarray, step: int) -> Loss:
        """Sum of the shares of `unexplained`."""
        shares = unexplained(self.network, *crops_at(self.training, batch))
        loss = torch.stack(list(shares.values())).sum()
        return Loss(loss, loss, torch.tensor(len(batch)))

    @torch.inference_mode()
    def validate(self) -> dict[str, float]:
        """Unexplained shares of all crops, see `unexplained`, with some of them in memory at a time."""
        crops = self.validation
        mean = torch.from_numpy(np.mean(crops.embedding, axis=0, dtype=np.float64).astype(np.float32))
        blocks = np.split(np.arange(len(crops)), range(_CROPS_AT_ONCE, len(crops), _CROPS_AT_ONCE))
        parts = torch.stack([squares(self.network, *crops_at(crops, rows), mean) for rows in blocks])
        missed, spread = parts.double().sum(dim=0)
        return {f"validation_{n}_missed": float(s) for n, s in zip(_FIGURES, missed / spread, strict=True)}


def unexplained(student: GridEncoder, crops: Tensor, embeddings: Tensor) -> Mapping[str, Tensor]:
    """Share of the teacher's variance that a student misses, sum |c - c'|^2 / sum |c - mean c|^2.

    Of the embedding c, and of the latent features W c, the first layer of the recurrent network.

    Args:
        student: with the teacher's fully connected layer W.
        crops: [N, cells, cells]
        embeddings: the teacher's. [N, C]
    """
    missed, spread = squares(student, crops, embeddings, embeddings.mean(dim=0))
    return dict(zip(_FIGURES, missed / spread, strict=True))


def squares(student: GridEncoder, crops: Tensor, embeddings: Tensor, mean: Tensor) -> Tensor:
    """Sums that `unexplained` divides, [missed, spread] x [embedding, latent]: |c - c'|^2, |c - mean|^2."""
    parts = (student.embedding(crops) - embeddings, embeddings - mean)
    weight = student.fc.weight
    return torch.stack([torch.stack([p.square().sum(), (p @ weight.T).square().sum()]) for p in parts])


def crops_at(crops: EmbeddedCrops, rows: np.ndarray) -> tuple[Tensor, Tensor]:
    """Crops and embeddings of some rows. [B, cells, cells], [B, C] float32."""
    embeddings = torch.from_numpy(crops.embedding[rows]).to(torch.float32)
    return float_crops(crops.packed[rows], crops.cells), embeddings
