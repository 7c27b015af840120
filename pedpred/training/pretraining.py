"""Pre-training of the grid encoder."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import torch
from torch.nn.utils import clip_grad_norm_

from pedpred.models.contract import Loss
from pedpred.models.lstm.autoencoder import GridAutoencoder, intersection_over_union, reconstruction_loss
from pedpred.models.lstm.encoding import CROPS_AT_ONCE, float_crops
from pedpred.settings import In
from pedpred.training.loop import Learner
from pedpred.training.schedule import Schedule


@dataclass(frozen=True, kw_only=True)
class AutoencoderSettings(Schedule):
    """How the auto-encoder is trained.

    Attributes:
        latent: width of the latent space.
        batch: crops per step.
        clip_norm: largest gradient norm.
        tied: the decoder uses the encoder's weights.
    """

    latent: Annotated[int, In("[1, 100000]")]
    batch: Annotated[int, In("[1, 1000000]")]
    clip_norm: Annotated[float, In("(0, 1e6]")]
    tied: bool = True


class AutoencoderLearner(Learner):
    """An auto-encoder and its bit-packed crops; it has no recurrent state."""

    network: GridAutoencoder
    settings: AutoencoderSettings

    def __init__(
        self, training: np.ndarray, validation: np.ndarray, cells: int, settings: AutoencoderSettings
    ):
        """Make random weights.

        Args:
            training: [M, cells^2 / 8] uint8
            validation: crops of other arrangements. [V, cells^2 / 8] uint8
            cells: cells per side of a crop.
            settings: see `AutoencoderSettings`.
        """
        torch.manual_seed(settings.seed)
        self.training, self.validation, self.cells, self.settings = training, validation, cells, settings
        self.network = GridAutoencoder(cells, settings.latent, settings.tied)
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=settings.lr)
        self.memory = {}

    def batches(self, done: int) -> Iterator[np.ndarray]:
        """Random training rows, sorted, because neighbours lie together on disk. [B] each."""
        rng = np.random.default_rng(self.settings.seed)
        drawn = (rng.integers(0, len(self.training), self.settings.batch) for _ in itertools.count())
        return map(np.sort, itertools.islice(drawn, done, None))

    def loss(self, batch: np.ndarray, step: int) -> Loss:
        """Reconstruction loss."""
        crops = float_crops(self.training[batch], self.cells)
        loss = reconstruction_loss(crops, self.network(crops))
        return Loss(loss, loss, torch.tensor(len(batch)))

    def clip(self) -> None:
        """One norm for all weights."""
        clip_grad_norm_(self.network.parameters(), self.settings.clip_norm)

    @torch.inference_mode()
    def validate(self) -> dict[str, float]:
        """Loss and intersection over union, computed in blocks of crops."""
        blocks = range(0, len(self.validation), CROPS_AT_ONCE)
        parts = [float_crops(self.validation[at : at + CROPS_AT_ONCE], self.cells) for at in blocks]
        truth, guess = torch.cat(parts), torch.cat([self.network(part) for part in parts])
        return {
            "validation_loss": float(reconstruction_loss(truth, guess)),
            "validation_iou": intersection_over_union(truth, guess),
        }
