"""The contract of networks, with or without a memory: what training, evaluation and export need of them.

One module or folder per architecture implements `NetworkSettings` and `ForecastNetwork`, one line of
`pedpred.models` names it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor, nn

UNITS = "[1, 65536]"
"""Valid numbers of units of a layer."""

Tensors = dict[str, Tensor]
"""Recurrent state, [N, ...] each, one row per track; or outputs, with the leading axes of the inputs."""


class NetworkSettings(Protocol):
    """Frozen settings of an architecture."""

    @classmethod
    def parse(cls, plain: Mapping[str, Any]) -> NetworkSettings:
        """Build from plain dictionaries (configuration or a checkpoint)."""

    def plain(self) -> dict[str, Any]:
        """The inverse of `parse`."""

    @property
    def channels_read(self) -> tuple[str, ...]:
        """Names of the channels that the network reads."""

    def build(self, widths: Mapping[str, int], horizon_steps: int) -> ForecastNetwork:
        """A network with random weights.

        Args:
            widths: channel -> numbers per step; they come from the data.
            horizon_steps: forecast steps P.
        """


class Loss(NamedTuple):
    """Losses of a batch.

    Attributes:
        total: what the gradient is taken of. []
        reported: what the training curve shows. []
        weight: number of targets that `reported` is the mean of. []
    """

    total: Tensor
    reported: Tensor
    weight: Tensor


class ForecastNetwork(nn.Module, ABC):
    """A network that reads the channels of a track step by step and forecasts after every step.

    One without a memory has an empty state.

    Attributes:
        settings: of the architecture.
        widths: channel -> numbers per step, of the channels that it reads.
        horizon_steps: forecast steps P.
    """

    def __init__(self, settings: NetworkSettings, widths: Mapping[str, int], horizon_steps: int):
        super().__init__()
        self.settings = settings
        self.widths = {name: widths[name] for name in settings.channels_read}
        self.horizon_steps = horizon_steps

    @property
    @abstractmethod
    def state_shapes(self) -> dict[str, tuple[int, ...]]:
        """Tensors of the recurrent state: name -> shape per track."""

    def start(self, tracks: int) -> Tensors:
        """State of tracks before their first step: zeros. [N, ...] each."""
        zeros = next(self.parameters()).new_zeros
        return {name: zeros(tracks, *shape) for name, shape in self.state_shapes.items()}

    @abstractmethod
    def forward(self, inputs: Mapping[str, Tensor], state: Tensors) -> tuple[Tensors, Tensors]:
        """Forecast after every step of a sub-sequence.

        Args:
            inputs: channel -> [B, L, width]; of networks without a memory also [B, width], single instants,
                so such a network must work with any leading axes.
            state: before the sub-sequence. [B, ...] each

        Returns:
            Outputs, whose meaning is the network's own, [B, L, ...] each, or [B, ...] for single instants;
            and the state afterwards.
        """

    def step(self, inputs: Mapping[str, Tensor], state: Tensors) -> tuple[Tensors, Tensors]:
        """Forecast after a single step: `forward` without its axis L."""
        outputs, after = self({name: values[:, None] for name, values in inputs.items()}, state)
        return {name: values[:, 0] for name, values in outputs.items()}, after

    @abstractmethod
    def loss(self, outputs: Tensors, future: Tensor, known: Tensor, dt_s: float) -> Loss:
        """Loss of the forecasts.

        Args:
            outputs: of `forward`.
            future: true velocities, agent frame, m/s. [..., P, 2]
            known: which of them count. [..., P] bool
            dt_s: time between steps, s.
        """

    @property
    @abstractmethod
    def score_names(self) -> tuple[str, ...]:
        """Names of the validation scores; the first one chooses the weights."""

    @abstractmethod
    def scores(self, outputs: Tensors, future: Tensor, dt_s: float) -> Tensors:
        """Validation scores per step, in the order of `score_names`; lower is better. [..., P] each."""

    @abstractmethod
    def decode(self, outputs: Tensors, dt_s: float) -> Tensors:
        """The outputs as tensors of `pedpred.forecasting.tensors`, with leading axes [...]."""

    def clipped_groups(self) -> list[list[nn.Parameter]]:
        """Groups of weights whose gradients are clipped by a norm of their own."""
        return [list(self.parameters())]

    def take_encoder(self, encoder: nn.Module) -> None:
        """Initialise what a pre-trained encoder of some input can initialise; nothing by default."""


def reset(state: Tensors, starts: Tensor) -> Tensors:
    """The state with zeros for tracks that start. starts: [N] bool."""
    return {
        name: torch.where(starts.view(-1, *[1] * (value.dim() - 1)), torch.zeros_like(value), value)
        for name, value in state.items()
    }


def detach(state: Tensors) -> Tensors:
    """The same state, cut off from the gradient."""
    return {name: value.detach() for name, value in state.items()}


def select(tensors: Mapping[str, Tensor], rows: Tensor | slice) -> Tensors:
    """Some rows (mask, indices or slice) of every tensor."""
    return {name: value[rows] for name, value in tensors.items()}


def mean_over(values: Tensor, known: Tensor) -> Tensor:
    """Mean of the values that are known; 0 where none is. [...] and [...] bool -> []."""
    return (values * known).sum() / known.sum().clamp(min=1)


def velocity_distance(predicted: Tensor, truth: Tensor) -> Tensor:
    """Euclidean distance of velocities (Pfeiffer et al. 2018, eq. 5), m/s. [..., 2] x 2 -> [...]."""
    return torch.linalg.vector_norm(predicted - truth, dim=-1)


def displacements(velocities: Tensor, truth: Tensor, dt_s: float) -> Tensor:
    """From the forecast to the true path, both integrated, m. [..., P, 2] x 2 -> [..., P, 2]."""
    return torch.cumsum((truth - velocities) * dt_s, dim=-2)
