"""A network without memory: several weighted paths from the last seconds, the neighbours and the obstacles.

Everything that it reads is seen from the person, so that nothing depends on where the world's origin and
axes lie or on how long a track is. It looks at each situation and at its mirror image, and half of the modes
come from either, so that mirrored worlds have mirrored forecasts. Somebody who never moved has no heading,
and is forecast to stand, as uncertain in each direction. Its paths are corrections of the tracker's own
forecast, constant velocity.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.functional import log_softmax

from pedpred.errors import ValueRuleError
from pedpred.networks.contract import Loss, RecurrentNetwork, Tensors, displacements, mean_over
from pedpred.networks.gaussian import covariance_of, initial_spread, negative_log_density, spread_of
from pedpred.networks.mirror import mirrored_inputs, mirrored_outputs
from pedpred.networks.surroundings import BeamEncoder, NeighbourEncoder, motion_known, own_motion

CHANNELS_READ = ("state", "history", "track", "neighbours", "beams")
SURROUNDINGS = ("history", "neighbours", "beams")
"""What it can do without: the past, other people, obstacles."""
_ENCODERS = ("own", "neighbours", "beams")
_POSITIVE = ("units", "motion_units", "neighbour_units", "obstacle_units", "sharpness", "balance_m")


@dataclass(frozen=True)
class MixtureSettings:
    """Settings of a `MixtureNetwork`.

    Attributes:
        modes: K; an even number if half of them come from the mirror image.
        units: of the fully connected layers behind the encoders.
        motion_units: of the encoder of the person's own motion.
        neighbour_units: of the encoder of each neighbour.
        obstacle_units: of the encoder of the obstacles.
        likelihood: weight of the negative log likelihoods beside the error of the point forecast.
        closest: weight of the error of the closest mode.
        sharpness: steps of a path that count as independent in its likelihood.
        balance_m: errors of people are weighed by 1 / (balance_m + error of constant velocity).
        mirrored: whether it looks at the mirror image, too.
        unread: those of `SURROUNDINGS` that it does not read.
        frozen: those of its encoders whose weights stay as they are drawn: "own", "neighbours", "beams".
    """

    modes: int = 6
    units: int = 384
    motion_units: int = 128
    neighbour_units: int = 96
    obstacle_units: int = 128
    likelihood: float = 0.1
    closest: float = 0.3
    sharpness: float = 3.0
    balance_m: float = 0.3
    mirrored: bool = True
    unread: Sequence[str] = ()
    frozen: Sequence[str] = ()

    def __post_init__(self) -> None:
        if self.modes < 1 or (self.mirrored and self.modes % 2):
            raise ValueRuleError("modes", self.modes, "use an even number: half of them are mirror images")
        for name, known in {"unread": SURROUNDINGS, "frozen": _ENCODERS}.items():
            if not set(getattr(self, name)) <= set(known):
                raise ValueRuleError(name, getattr(self, name), f"known are {', '.join(known)}")
        for name in _POSITIVE:
            if not getattr(self, name) > 0:
                raise ValueRuleError(name, getattr(self, name), "it must be positive")

    @classmethod
    def parse(cls, plain: Mapping[str, Any]) -> MixtureSettings:
        """Build from plain dictionaries."""
        return cls(**plain)

    def plain(self) -> dict[str, Any]:
        """The inverse of `parse`."""
        return asdict(self)

    @property
    def channels_read(self) -> tuple[str, ...]:
        """Names of the channels."""
        return CHANNELS_READ

    def build(self, widths: Mapping[str, int], horizon_steps: int) -> MixtureNetwork:
        """A network with random weights."""
        return MixtureNetwork(self, widths, horizon_steps)


class MixtureNetwork(RecurrentNetwork):
    """An encoder per channel, fully connected layers, and a head per output.

    Its outputs, agent frame: "velocities" of the point forecast [..., P, 2], m/s; "modes", the velocities of
    each mode [..., K, P, 2]; "weight", their log probabilities [..., K]; "spread" (a, c, k) of the positions
    in each mode [..., K, P, 3], see `pedpred.networks.gaussian`; "prior", constant velocity.
    """

    settings: MixtureSettings

    def __init__(self, settings: MixtureSettings, widths: Mapping[str, int], horizon_steps: int):
        super().__init__(settings, widths, horizon_steps)
        half, units = settings.modes // (2 if settings.mirrored else 1), settings.units
        own = 3 + sum(widths[name] for name in ("state", "history", "track"))
        motion = settings.motion_units
        self.own = nn.Sequential(nn.Linear(own, motion), nn.ReLU(), nn.Linear(motion, motion), nn.ReLU())
        self.neighbours = NeighbourEncoder(motion, settings.neighbour_units)
        self.beams = BeamEncoder(widths["beams"], settings.obstacle_units)
        fused = motion + self.neighbours.units + self.beams.units
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise((fused, units, units, units)))
        steps = (horizon_steps,)
        self.shapes = {
            "velocities": (*steps, 2),
            "modes": (half, *steps, 2),
            "weight": (half,),
            "spread": (half, *steps, 3),
        }
        self.heads = nn.ModuleDict(
            {k: nn.Linear(units, torch.Size(s).numel()) for k, s in self.shapes.items()}
        )
        with torch.no_grad():
            for name, weight in self.heads.named_parameters():  # an untrained network continues the motion
                weight.mul_(0.0 if name.startswith("velocities") else 0.3)
            spread = self.heads.get_parameter("spread.bias")
            spread.copy_(initial_spread(horizon_steps).repeat(half, 1).flatten())
        for name in settings.frozen:
            self.get_submodule(name).requires_grad_(False)

    @property
    def state_shapes(self) -> dict[str, tuple[int, ...]]:
        """None: the history is an input."""
        return {}

    def forward(self, inputs: Mapping[str, Tensor], state: Tensors) -> tuple[Tensors, Tensors]:
        """Forecast after every step; see `RecurrentNetwork.forward`."""
        axes = inputs["state"].shape[:-1]
        sides = [self._read({name: inputs[name].flatten(0, -2) for name in self.widths})]
        if self.settings.mirrored:
            sides.append(mirrored_inputs(sides[0]))
        seen = self._look({name: torch.cat([side[name] for side in sides]) for name in self.widths})
        looks = [{k: v.unflatten(0, (len(sides), -1))[n] for k, v in seen.items()} for n in range(len(sides))]
        looks[1:] = [mirrored_outputs(look) for look in looks[1:]]
        outputs = {
            name: torch.cat([look[name] for look in looks], dim=1) for name in ("modes", "weight", "spread")
        }
        outputs["weight"] = log_softmax(outputs["weight"], dim=-1)
        now = sides[0]["state"][:, None].expand(-1, self.horizon_steps, -1)
        outputs["velocities"] = now + torch.stack([look["velocities"] for look in looks]).mean(dim=0)
        outputs["modes"] = now[:, None] + outputs["modes"]
        outputs["prior"] = now
        return {name: values.unflatten(0, axes) for name, values in outputs.items()}, {}

    def _read(self, inputs: Tensors) -> Tensors:
        """Zeros in place of what the settings leave unread. [N, width] each."""
        return inputs | {name: torch.zeros_like(inputs[name]) for name in self.settings.unread}

    def _look(self, inputs: Mapping[str, Tensor]) -> Tensors:
        """Corrections, modes and their weights in some situations. [N, ...] each."""
        own, known = self.own(own_motion(inputs)), motion_known(inputs)
        around = self.neighbours(inputs["neighbours"], inputs["state"], own)
        first, *others = self.layers
        seen = [own, known * around, known * self.beams(inputs["beams"])]
        fused = torch.relu(first(torch.cat(seen, dim=-1)))
        for layer in others:
            fused = fused + torch.relu(layer(fused))
        outputs = {
            name: head(fused).float().unflatten(-1, self.shapes[name]) for name, head in self.heads.items()
        }
        return _without_direction(outputs, known)

    def loss(self, outputs: Tensors, future: Tensor, known: Tensor, dt_s: float) -> Loss:
        """Mean distance of the point forecast and of the closest mode, and two negative log likelihoods.

        Distances are weighed by 1 / (balance_m + error of constant velocity), so that people who hardly move
        count as much as those who turn. The likelihood of every step by itself is what coverage measures;
        that of whole paths divides the modes among the ways that people may take.
        """
        how, steps = self.settings, known.sum(dim=-1)
        apart = displacements(outputs["modes"], future[..., None, :, :], dt_s)
        error, straight = (
            _over_steps(_length(displacements(outputs[name], future, dt_s)), known)
            for name in ("velocities", "prior")
        )
        closest = _over_steps(_length(apart), known[..., None, :]).amin(dim=-1)
        weight = (steps > 0) / (how.balance_m + straight)
        distance = ((error + how.closest * closest) * weight).sum() / weight.sum().clamp(min=1e-6)
        density = -negative_log_density(apart, spread_of(outputs["spread"]))
        each = -torch.logsumexp(outputs["weight"][..., None] + density, dim=-2)
        along = outputs["weight"] + how.sharpness * _over_steps(density, known[..., None, :])
        whole = -torch.logsumexp(along, dim=-1) / how.sharpness
        likelihood = mean_over(each.clamp(max=20.0), known) + mean_over(whole.clamp(max=20.0), steps > 0)
        total = distance + how.likelihood * likelihood
        return Loss(total, mean_over(error, steps > 0), (steps > 0).sum())

    @property
    def score_names(self) -> tuple[str, ...]:
        """Displacement of the point forecast and of the best mode, and the likelihood."""
        return ("ade_m", "min_ade_m", "nll")

    def scores(self, outputs: Tensors, future: Tensor, dt_s: float) -> Tensors:
        """Displacements, m; and the negative log likelihood of the positions, nats. [..., P] each."""
        apart = displacements(outputs["modes"], future[..., None, :, :], dt_s)
        best = _length(apart).mean(dim=-1).argmin(dim=-1)[..., None, None]
        density = -negative_log_density(apart, spread_of(outputs["spread"]))
        return {
            "ade_m": _length(displacements(outputs["velocities"], future, dt_s)),
            "min_ade_m": torch.take_along_dim(_length(apart), best, dim=-2).squeeze(-2),
            "nll": -torch.logsumexp(outputs["weight"][..., None] + density, dim=-2),
        }

    def answer(self, outputs: Tensors, dt_s: float) -> Tensors:
        """The point forecast and the modes."""
        return {
            "velocities": outputs["velocities"],
            "path": torch.cumsum(outputs["modes"] * dt_s, dim=-2),
            "weight": outputs["weight"].exp(),
            "covariance": covariance_of(spread_of(outputs["spread"])),
        }


def _without_direction(outputs: Tensors, known: Tensor) -> Tensors:
    """Outputs that know of a heading only as far as a motion is known: 0 no, 1 yes. [N, ...], [N, 1]."""
    ahead = known[..., None]
    spread = outputs["spread"]
    round_ = spread[..., :2].mean(dim=-1, keepdim=True) * spread.new_tensor([1.0, 1.0, 0.0])
    return {
        "velocities": ahead * outputs["velocities"],
        "modes": ahead[..., None] * outputs["modes"],
        "weight": outputs["weight"],
        "spread": round_ + ahead[..., None] * (spread - round_),
    }


def _length(vectors: Tensor) -> Tensor:
    return torch.linalg.vector_norm(vectors, dim=-1)


def _over_steps(values: Tensor, known: Tensor) -> Tensor:
    """Mean over the known steps of each row; 0 where there is none. [..., P] and [..., P] bool -> [...]."""
    return (values * known).sum(dim=-1) / known.sum(dim=-1).clamp(min=1)
