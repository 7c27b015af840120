"""A network without memory: several weighted paths from the last seconds, the neighbours and the obstacles.

Everything that it reads is seen from the person, so that nothing depends on where the world's origin and
axes lie or on how long a track is. It looks at each situation and at its mirror image, and half of the modes
come from either, so that mirrored worlds have mirrored forecasts. Somebody who never moved has no heading,
and is forecast to stand, as uncertain in each direction. Its paths are corrections of the tracker's own
forecast, constant velocity.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import chain, pairwise
from typing import Annotated, Any

import torch
from torch import Tensor, nn
from torch.nn.functional import linear, log_softmax

from pedpred.errors import ValueRuleError
from pedpred.models.contract import UNITS, ForecastNetwork, Loss, Tensors, displacements, mean_over
from pedpred.models.gaussian import covariance_of, initial_spread, negative_log_density, spread_of
from pedpred.models.mixture.encoders import BeamEncoder, NeighbourEncoder, motion_known, own_motion, own_signs
from pedpred.models.mixture.features.nearest import NEIGHBOUR
from pedpred.models.mixture.mirror import MirroredLinear
from pedpred.settings import In, Settings, load

CHANNELS_READ = ("state", "history", "track", "neighbours", "beams")
SURROUNDINGS = ("history", "neighbours", "beams")
"""What it can do without: the past, other people, obstacles."""
_VELOCITIES = "neighbour_velocities"
_ENCODERS = ("own", "neighbours", "beams")


@dataclass(frozen=True)
class MixtureSettings(Settings):
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
        balance_m: errors of people are weighted by 1 / (balance_m + error of constant velocity).
        mirrored: whether it looks at the mirror image, too.
        unread: those of `SURROUNDINGS` that it does not read; or "neighbour_velocities", then it reads where
            neighbours are, as the angular grid of the LSTM says it, and not how they move.
        frozen: those of its encoders whose weights stay as they are drawn: "own", "neighbours", "beams".
    """

    modes: Annotated[int, In("[1, 1000]")] = 12
    units: Annotated[int, In(UNITS)] = 384
    motion_units: Annotated[int, In(UNITS)] = 128
    neighbour_units: Annotated[int, In(UNITS)] = 96
    obstacle_units: Annotated[int, In(UNITS)] = 128
    likelihood: Annotated[float, In("[0, 1e6]")] = 0.1
    closest: Annotated[float, In("[0, 1e6]")] = 0.3
    sharpness: Annotated[float, In("(0, 1e6]")] = 3.0
    balance_m: Annotated[float, In("(0, 1e6]")] = 0.3
    mirrored: bool = True
    unread: tuple[str, ...] = ()
    frozen: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mirrored and self.modes % 2:
            raise ValueRuleError("modes", self.modes, "use an even number: half of them are mirror images")
        for name, known in {"unread": (*SURROUNDINGS, _VELOCITIES), "frozen": _ENCODERS}.items():
            if not set(getattr(self, name)) <= set(known):
                raise ValueRuleError(name, getattr(self, name), f"known are {', '.join(known)}")

    @classmethod
    def parse(cls, plain: Mapping[str, Any]) -> MixtureSettings:
        """Build from plain dictionaries."""
        settings: MixtureSettings = load(cls, plain)
        return settings

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


class MixtureNetwork(ForecastNetwork):
    """An encoder per channel, fully connected layers, and a head per output.

    Its outputs, agent frame: "velocities" of the point forecast [..., P, 2], m/s; "modes", the velocities of
    each mode [..., K, P, 2]; "weight", their log probabilities [..., K]; "spread", raw numbers that
    `pedpred.models.gaussian.spread_of` turns into (a, c, k) of the positions in each mode [..., K, P, 3];
    "prior", constant velocity, [..., P, 2], m/s.

    Attributes:
        sides: 1, or 2 with the mirror image.
        sizes: how many numbers each head gives for a side.
        signs: of all these numbers, for each side: -1 where the mirror image changes the sign.
            [sides, sum of sizes]
    """

    settings: MixtureSettings

    def __init__(self, settings: MixtureSettings, widths: Mapping[str, int], horizon_steps: int):
        super().__init__(settings, widths, horizon_steps)
        self.sides = 2 if settings.mirrored else 1
        half, units, motion = settings.modes // self.sides, settings.units, settings.motion_units
        first = MirroredLinear(own_signs(widths["history"]), motion, self.sides)
        self.own = nn.Sequential(first, nn.ReLU(), nn.Linear(motion, motion), nn.ReLU())
        self.neighbours = NeighbourEncoder(motion, widths["neighbours"], settings.neighbour_units, self.sides)
        self.beams = BeamEncoder(widths["beams"], settings.obstacle_units, self.sides)
        fused = motion + self.neighbours.units + self.beams.units
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise((fused, units, units, units)))
        paths = half * horizon_steps
        # Signs of the numbers of each head in the mirror image.
        left = {
            "velocities": [1.0, -1.0] * horizon_steps,
            "modes": [1.0, -1.0] * paths,
            "weight": [1.0] * half,
            "spread": [1.0, 1.0, -1.0] * paths,
        }
        self.heads = nn.ModuleDict({name: nn.Linear(units, len(signs)) for name, signs in left.items()})
        self.sizes, mirrored = [len(signs) for signs in left.values()], list(chain(*left.values()))
        self.signs = [[1.0] * len(mirrored), mirrored][: self.sides]
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
        """Forecast after every step; see `ForecastNetwork.forward`."""
        axes = inputs["state"].shape[:-1]
        outputs, after = self.step({name: inputs[name].flatten(0, -2) for name in self.widths}, state)
        return {name: values.unflatten(0, axes) for name, values in outputs.items()}, after

    def step(self, inputs: Mapping[str, Tensor], state: Tensors) -> tuple[Tensors, Tensors]:
        """Forecast some people; see `ForecastNetwork.step`."""
        modes, steps = self.settings.modes, self.horizon_steps
        seen = {n: torch.zeros_like(v) if n in self.settings.unread else v for n, v in inputs.items()}
        if _VELOCITIES in self.settings.unread:
            seen["neighbours"] = _standing(seen["neighbours"])
        motion = own_motion(seen)
        known = motion_known(motion)  # from 0 to 1, not the mask of steps that `loss` gets
        velocities, paths, weight, spread = self._heads(self._look(seen, motion, known))
        now, known = seen["state"][:, None].expand(-1, steps, -1), known[..., None]
        a, c, k = spread.reshape(-1, modes, steps, 3).unbind(-1)  # raw: equal raw numbers are equal widths
        wide, longer = 0.5 * (a + c), 0.5 * known * (a - c)  # without a heading, as wide in each direction
        return {
            "velocities": now + known * velocities.mean(dim=1).reshape(-1, steps, 2),
            "modes": now[:, None] + (known * paths).reshape(-1, modes, steps, 2),
            "weight": log_softmax(weight.reshape(-1, modes), dim=-1),
            "spread": torch.stack([wide + longer, wide - longer, known * k], dim=-1),
            "prior": now,
        }, {}

    def _look(self, inputs: Mapping[str, Tensor], motion: Tensor, known: Tensor) -> Tensor:
        """Everything that is seen, from each side; known: of `motion_known`. [N * sides, units]."""
        motion = self.own(motion)
        around = self.neighbours(inputs["neighbours"], inputs["state"], motion)
        surroundings = torch.cat([around, self.beams(inputs["beams"])], dim=-1)
        known = torch.cat([known] * self.sides, dim=-1).reshape(-1, 1)
        first, *others = self.layers
        fused = torch.relu(first(torch.cat([motion, known * surroundings], dim=-1)))
        for layer in others:
            fused = fused + torch.relu(layer(fused))
        return fused

    def _heads(self, fused: Tensor) -> tuple[Tensor, ...]:
        """The output of each head, turned back from the mirror. [N, sides, ...] each."""
        weight, bias = (
            torch.cat([self.heads.get_parameter(f"{name}.{kind}") for name in self.heads])
            for kind in ("weight", "bias")
        )
        outputs = linear(fused, weight, bias).float().reshape(-1, self.sides, len(bias))
        return (outputs * outputs.new_tensor(self.signs)).split(self.sizes, dim=-1)

    def loss(self, outputs: Tensors, future: Tensor, known: Tensor, dt_s: float) -> Loss:
        """Mean distance of the point forecast and of the closest mode, and two negative log likelihoods.

        Distances are weighted by 1 / (balance_m + error of constant velocity), so that people who hardly move
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

    def decode(self, outputs: Tensors, dt_s: float) -> Tensors:
        """The point forecast and the modes."""
        return {
            "velocities": outputs["velocities"],
            "path": torch.cumsum(outputs["modes"] * dt_s, dim=-2),
            "weight": outputs["weight"].exp(),
            "covariance": covariance_of(spread_of(outputs["spread"])),
        }


def _length(vectors: Tensor) -> Tensor:
    return torch.linalg.vector_norm(vectors, dim=-1)


def _over_steps(values: Tensor, known: Tensor) -> Tensor:
    """Mean over the known steps of each row; 0 where there is none. [..., P] and [..., P] bool -> [...]."""
    return (values * known).sum(dim=-1) / known.sum(dim=-1).clamp(min=1)


def _standing(neighbours: Tensor) -> Tensor:
    """Neighbours whose velocities are zero. [N, neighbours * NEIGHBOUR]."""
    place, velocity, weight = neighbours.reshape(len(neighbours), -1, NEIGHBOUR).split([2, 2, 1], dim=-1)
    return torch.cat([place, torch.zeros_like(velocity), weight], dim=-1).flatten(1)
