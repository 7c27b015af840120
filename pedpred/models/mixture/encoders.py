"""Encoders of a person's own motion, of neighbours as a set, and of obstacles along beams."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from pedpred.models.mixture.features import OLD
from pedpred.models.mixture.features.history import PAST
from pedpred.models.mixture.features.nearest import NEIGHBOUR
from pedpred.models.mixture.mirror import MirroredLinear, mirrored_beams

_SOFT = 0.05
"""m^2/s^2; keeps the time of the closest approach finite for people who walk side by side."""

_STIRS = 1e-3
"""m/s or m; a motion of this size counts half. Rounding of world coordinates is far below."""


# Numbers of `own_motion`, of T past positions that include the present one: state 2 | history 3 T | last 2 |
# spread 3 | age 1 | seen 2 | speed 1 | jitter T - 2. `own_signs` and `motion_known` repeat this order.
def own_motion(inputs: Mapping[str, Tensor]) -> Tensor:
    """A person's own channels, scaled to about 1: "state", "history", "track". [N, 4 T + 9].

    The last T - 2 numbers are how far each of the T past positions is from the middle between its
    neighbours in time, which tells how noisy detections are.
    """
    state, track = inputs["state"], inputs["track"]
    last, variance, age = track[:, :2], track[:, 2:5], track[:, 5:]  # variance: P_pp, P_pv, P_vv
    seen = (OLD * age - age.new_tensor([0.0, 1.0])).clamp(0.0, 1.0)  # more than once, more than twice
    spread = variance.clamp(min=0.0).sqrt() * variance.new_tensor([5.0, 3.0, 1.0])
    speed = torch.linalg.vector_norm(state, dim=-1, keepdim=True)
    x, y, there = inputs["history"].unflatten(-1, (-1, PAST)).unbind(-1)  # [N, T] each
    jitter = there[:, 2:] * (1.0 - torch.exp(-5.0 * _length(_bend(x), _bend(y))))
    return torch.cat([state, inputs["history"], 0.5 * last, spread, age, seen, speed, jitter], dim=-1)


def _bend(x: Tensor) -> Tensor:
    """Second differences. [N, T] -> [N, T - 2]."""
    return x[:, 2:] - 2.0 * x[:, 1:-1] + x[:, :-2]


def own_signs(history: int) -> list[float]:
    """Those of `own_motion` that change their sign in the mirror: -1, for so many numbers of "history"."""
    past = history // PAST
    return [1.0, -1.0, *[1.0, -1.0, 1.0] * past, 1.0, -1.0, *[1.0] * (past + 5)]


def motion_known(motion_inputs: Tensor) -> Tensor:
    """How far a person's motion, and with it the heading, is known: 0 without any, 1 above 1 cm/s. [N, 1].

    Args:
        motion_inputs: of `own_motion`.
    """
    past = (motion_inputs.shape[-1] - 9) // (PAST + 1)
    # (m/s or m) per number; 2: `own_motion` halves "last"
    motion = [1.0, 1.0, *[1.0, 1.0, 0.0] * past, 2.0, 2.0, *[0.0] * (past + 5)]
    size = (motion_inputs.abs() * motion_inputs.new_tensor(motion)).amax(dim=-1, keepdim=True)
    return size / (size + _STIRS)


class NeighbourEncoder(nn.Module):
    """The same small network for every neighbour, then their largest and their summed features.

    Attributes:
        units: of the result: twice the argument `units`.
        crowd: number of neighbours that are read, K.
        wide: numbers that the small network gives for a neighbour, of all sides.
    """

    def __init__(self, observer: int, width: int, units: int, sides: int):
        super().__init__()
        self.units, self.crowd, self.wide = 2 * units, width // NEIGHBOUR, sides * units
        self.first = MirroredLinear([1.0, -1.0] * 3 + [1.0] * 4, units, sides)  # signs of `_facts`, in order
        self.second, self.observer = nn.Linear(units, units), nn.Linear(observer, units)

    def forward(self, neighbours: Tensor, state: Tensor, encoded_motion: Tensor) -> Tensor:
        """Encode everybody around some observers.

        Args:
            neighbours: see `pedpred.models.mixture.features.nearest`. [N, K * NEIGHBOUR]
            state: the observers' velocities, agent frame, m/s. [N, 2]
            encoded_motion: of the observers, from each side. [N * sides, observer]

        Returns:
            [N * sides, self.units]
        """
        crowd, wide, units = self.crowd, self.wide, self.second.in_features
        x, y, vx, vy, weight = neighbours.reshape(-1, crowd, NEIGHBOUR).unbind(-1)  # [N, K] each
        sx, sy = state[:, :1], state[:, 1:]
        facts = torch.stack(_facts(x, y, vx, vy, vx - sx, vy - sy), dim=-1)
        each = facts.reshape(-1, self.first.in_features) @ self.first.both.T
        observer = self.observer(encoded_motion) + self.first.bias
        hidden = torch.relu(each.reshape(-1, crowd, wide) + observer.reshape(-1, 1, wide))
        each = torch.relu(self.second(hidden.reshape(-1, units)))
        each = weight[..., None] * each.reshape(-1, crowd, wide)
        seen = each.amax(dim=1), 0.25 * each.sum(dim=1)
        return torch.cat([one.reshape(-1, units) for one in seen], dim=-1)


def _facts(x: Tensor, y: Tensor, vx: Tensor, vy: Tensor, rx: Tensor, ry: Tensor) -> list[Tensor]:
    """What is read of a neighbour, from its place, its velocity and the one relative to the observer."""
    approach, speed2 = x * rx + y * ry, rx * rx + ry * ry
    meeting_s = (-approach / (speed2 + _SOFT)).clamp(0.0, 4.0)
    away, passing_m = _length(x, y), _length(x + meeting_s * rx, y + meeting_s * ry)
    close = [torch.exp(-away), 1.0 / (1.0 + away), 0.3 * meeting_s, torch.exp(-passing_m)]
    return [0.25 * x, 0.25 * y, rx, ry, vx, vy, *close]


def _length(x: Tensor, y: Tensor) -> Tensor:
    return (x * x + y * y).sqrt()


class BeamEncoder(nn.Module):
    """Patches of eight neighbouring beams share one layer; a second layer joins them.

    Beams are taken in groups of four: a patch is a group and the one before.

    Attributes:
        units: of the result.
        groups: number of groups.
    """

    def __init__(self, beams: int, units: int, sides: int):
        super().__init__()
        self.units, self.sides, self.groups = units, sides, beams // 4
        self.patch, self.join = nn.Linear(16, 32), nn.Linear(self.groups * 32, units)

    def forward(self, beams: Tensor) -> Tensor:
        """Encode distances to obstacles, m, from each side. [N, beams] -> [N * sides, units]."""
        seen = torch.cat([beams, mirrored_beams(beams)][: self.sides], dim=-1).reshape(-1, self.groups, 4)
        # 0.1: 1 / 10 m, the default of `beam_range_m`, whatever range is set
        group = torch.cat([1.0 - 0.1 * seen, torch.exp(-seen)], dim=-1)
        patches = torch.cat([group.roll(1, 1), group], dim=-1).reshape(-1, 16)
        return torch.relu(self.join(torch.relu(self.patch(patches)).reshape(-1, self.join.in_features)))
