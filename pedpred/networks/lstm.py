"""The recurrent motion network (Pfeiffer et al. 2018, figure 2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

from pedpred.errors import ConfigError
from pedpred.networks.gaussian import UNCERTAINTIES


@dataclass(frozen=True)
class ChannelWidths:
    """One input channel: fully connected embedding, then an LSTM of its own."""

    projection: int
    lstm: int


@dataclass(frozen=True)
class MotionSettings:
    """Everything that shapes a `MotionLstm`.

    Attributes:
        channels: input name -> widths; an input that is not named is not used.
        joint: units of the LSTM that fuses the channels.
        head: units of the fully connected layer before the output.
        horizon_steps: forecast velocities P.
        residual: the output is added to the tracked velocity instead of standing alone.
        dropout: probability that a unit in front of the head is dropped while training.
        uncertainty: what the network tells of its own error: "none", or a key of `UNCERTAINTIES`.
    """

    channels: Mapping[str, ChannelWidths]
    joint: int
    head: int
    horizon_steps: int
    residual: bool
    dropout: float = 0.0
    uncertainty: str = "none"

    def __post_init__(self) -> None:
        known = ("none", *UNCERTAINTIES)
        if self.uncertainty not in known:
            raise ConfigError("uncertainty", self.uncertainty, f"known uncertainties are {known}")

    @classmethod
    def parse(cls, plain: Mapping) -> MotionSettings:
        """Build from plain dictionaries (configuration or a checkpoint's description)."""
        unknown = set(plain["channels"]) - set(INPUT_WIDTHS)
        if unknown:
            raise ConfigError("channels", sorted(unknown), f"known channels are {sorted(INPUT_WIDTHS)}")
        # The joint LSTM reads the channels in this order, whatever order a file lists them in.
        names = [name for name in INPUT_WIDTHS if name in plain["channels"]]
        channels = {name: ChannelWidths(**plain["channels"][name]) for name in names}
        return cls(**{**plain, "channels": channels})

    def plain(self) -> dict:
        """The inverse of `parse`."""
        return asdict(self)


INPUT_WIDTHS = {"state": 2, "grid": 392, "angular": 72}
"""The channel table: what the network can look at, and how many numbers that is per step.

state: velocity, agent frame, m/s. grid: the frozen encoder's embedding of the occupancy crop.
angular: 1 - r / r_max of the angular pedestrian grid, so that an empty cone is 0.
"""

LEAK = 0.1
"""Slope of an embedding below zero: the auto-encoder's latent is linear, so no half of it may be lost."""


@dataclass(frozen=True)
class MotionState:
    """Recurrent memory of B lanes: per LSTM (hidden, cell), each [1, B, units]."""

    memory: dict[str, tuple[Tensor, Tensor]]

    def reset(self, starts: Tensor) -> MotionState:
        """Forget lanes in which a new track starts. starts: [B] bool."""
        keep = (~starts).to(torch.float32)[None, :, None]
        return MotionState({k: (h * keep, c * keep) for k, (h, c) in self.memory.items()})

    def detached(self) -> MotionState:
        """The same memory, cut off from the gradient."""
        return MotionState({k: (h.detach(), c.detach()) for k, (h, c) in self.memory.items()})


class Motion(NamedTuple):
    """What a network says about the next P steps, in agent frames.

    Attributes:
        velocities: m/s. [..., P, 2]
        spread: of the position error at the end of each step, (a, c, k) of `GaussianHead`; None from a
            network that tells none. [..., P, 3]
    """

    velocities: Tensor
    spread: Tensor | None


class MotionLstm(nn.Module):
    """Velocity, obstacles and neighbours in, the next P velocities out, step by step."""

    def __init__(self, settings: MotionSettings):
        super().__init__()
        self.settings = settings
        self.projections = nn.ModuleDict()
        self.lstms = nn.ModuleDict()
        for name, widths in settings.channels.items():
            self.projections[name] = nn.Linear(INPUT_WIDTHS[name], widths.projection)
            self.lstms[name] = nn.LSTM(widths.projection, widths.lstm, batch_first=True)
        fused = sum(widths.lstm for widths in settings.channels.values())
        self.joint = nn.LSTM(fused, settings.joint, batch_first=True)
        self.dropout = nn.Dropout(settings.dropout)
        self.head = nn.Linear(settings.joint, settings.head)
        self.out = nn.Linear(settings.head, 2 * settings.horizon_steps)
        # Made last: the random numbers before it are those of a network without it.
        self.uncertainty = (
            UNCERTAINTIES[settings.uncertainty](settings.joint, settings.horizon_steps)
            if settings.uncertainty != "none"
            else None
        )

    def start(self, lanes: int) -> MotionState:
        """Memory of tracks that have just been seen: zeros."""
        units = {name: widths.lstm for name, widths in self.settings.channels.items()}
        units["joint"] = self.settings.joint
        zeros = self.out.weight.new_zeros
        return MotionState({k: (zeros(1, lanes, n), zeros(1, lanes, n)) for k, n in units.items()})

    def forward(self, inputs: Mapping[str, Tensor], state: MotionState) -> tuple[Motion, MotionState]:
        """Forecast after every step of a sub-sequence.

        Args:
            inputs: channel name -> [B, L, width], see `INPUT_WIDTHS`.
            state: memory before the sub-sequence.

        Returns:
            Motion in the agent frame of each step, [B, L, ...], and the memory after it.
        """
        memory = {}
        hidden = []
        for name, lstm in self.lstms.items():
            embedded = leaky_relu(self.projections[name](inputs[name]), LEAK)
            channel, memory[name] = lstm(embedded, state.memory[name])
            hidden.append(channel)
        fused, memory["joint"] = self.joint(torch.cat(hidden, dim=-1), state.memory["joint"])
        head = torch.relu(self.head(self.dropout(fused)))
        velocities = self.out(head).unflatten(-1, (self.settings.horizon_steps, 2))
        if self.settings.residual:
            velocities = velocities + inputs["state"][..., None, :]
        spread = None if self.uncertainty is None else self.uncertainty(fused)
        return Motion(velocities, spread), MotionState(memory)

    def parts(self) -> list[list[nn.Parameter]]:
        """Weights of the mean and of its uncertainty; no gradient of one reaches the other."""
        spread = [] if self.uncertainty is None else list(self.uncertainty.parameters())
        own = {id(weight) for weight in spread}
        return [[weight for weight in self.parameters() if id(weight) not in own], spread]
