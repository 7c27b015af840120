"""Encoders of what surrounds a person: neighbours as a set, obstacles as distances along beams."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from pedpred.features.history import PAST
from pedpred.features.nearest import NEIGHBOUR
from pedpred.features.situation import OLD

_SOFT = 0.05
"""m^2/s^2; keeps the time of the closest approach finite for people who walk side by side."""

_STIRS = 1e-3
"""m/s or m; a motion of this size counts half. Rounding of world coordinates is far below."""


def own_motion(inputs: Mapping[str, Tensor]) -> Tensor:
    """A person's own channels, scaled to about 1: "state", "history", "track". [N, width + 3]."""
    state, track = inputs["state"], inputs["track"]
    last, variance, age = track[:, :2], track[:, 2:5], track[:, 5:]
    seen = (OLD * age - age.new_tensor([0.0, 1.0])).clamp(0.0, 1.0)  # more than once, more than twice
    spread = variance.clamp(min=0.0).sqrt() * variance.new_tensor([5.0, 3.0, 1.0])
    speed = torch.linalg.vector_norm(state, dim=-1, keepdim=True)
    return torch.cat([state, inputs["history"], 0.5 * last, spread, age, seen, speed], dim=-1)


def motion_known(inputs: Mapping[str, Tensor]) -> Tensor:
    """How far a person's motion, and with it the heading, is known: 0 without any, 1 above 1 cm/s. [N, 1]."""
    moved = inputs["history"].unflatten(-1, (-1, PAST))[..., :2].flatten(-2)
    motion = torch.cat([inputs["state"], inputs["track"][:, :2], moved], dim=-1)
    size = motion.abs().amax(dim=-1, keepdim=True)
    return size / (size + _STIRS)


class NeighbourEncoder(nn.Module):
    """The same small network for every neighbour, then their largest and their summed features.

    Attributes:
        units: of the result.
    """

    def __init__(self, own: int, units: int):
        super().__init__()
        self.units = 2 * units
        self.first, self.second = nn.Linear(10, units), nn.Linear(units, units)
        self.observer = nn.Linear(own, units)

    def forward(self, neighbours: Tensor, state: Tensor, own: Tensor) -> Tensor:
        """Encode everybody around some observers.

        Args:
            neighbours: see `pedpred.features.nearest`. [N, K * NEIGHBOUR]
            state: the observers' velocities, agent frame, m/s. [N, 2]
            own: the observers' encoded motion. [N, own]

        Returns:
            [N, units]
        """
        around = neighbours.unflatten(-1, (-1, NEIGHBOUR))
        position, velocity, weight = around[..., :2], around[..., 2:4], around[..., 4:]
        relative = velocity - state[:, None]
        away = torch.linalg.vector_norm(position, dim=-1, keepdim=True)
        approach = -(position * relative).sum(dim=-1, keepdim=True)
        meeting_s = (approach / (relative.square().sum(dim=-1, keepdim=True) + _SOFT)).clamp(0.0, 4.0)
        passing_m = torch.linalg.vector_norm(position + meeting_s * relative, dim=-1, keepdim=True)
        close = [torch.exp(-away), 1.0 / (1.0 + away), 0.3 * meeting_s, torch.exp(-passing_m)]
        facts = torch.cat([0.25 * position, relative, velocity, *close], dim=-1)
        hidden = torch.relu(self.first(facts) + self.observer(own)[:, None])
        each = weight * torch.relu(self.second(hidden))
        return torch.cat([each.amax(dim=1), 0.25 * each.sum(dim=1)], dim=-1)


class BeamEncoder(nn.Module):
    """Patches of eight neighbouring beams, every fourth, share one layer; a second one joins them.

    Attributes:
        units: of the result.
    """

    def __init__(self, beams: int, units: int):
        super().__init__()
        self.units = units
        self.patch, self.join = nn.Linear(16, 32), nn.Linear(beams // 4 * 32, units)

    def forward(self, beams: Tensor) -> Tensor:
        """Encode distances to obstacles, m. [N, beams] -> [N, units]."""
        near = torch.stack([1.0 - 0.1 * beams, torch.exp(-beams)], dim=1)
        quarter = near.unflatten(-1, (-1, 4)).transpose(1, 2).flatten(-2)
        patches = torch.cat([quarter.roll(1, 1), quarter], dim=-1)
        return torch.relu(self.join(torch.relu(self.patch(patches)).flatten(1)))
