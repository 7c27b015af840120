"""The recurrent motion network (Pfeiffer et al. 2018, figure 2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any

import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

from pedpred.errors import ValueRuleError
from pedpred.models.contract import (
    UNITS,
    ForecastNetwork,
    Loss,
    Tensors,
    displacements,
    mean_over,
    velocity_distance,
)
from pedpred.models.gaussian import UNCERTAINTIES, covariance_of, negative_log_density
from pedpred.models.lstm.autoencoder import GridEncoder
from pedpred.settings import In, Settings, check_choice, load

CHANNELS = ("state", "grid", "angular")
"""What the network can read at each step.

state: velocity, agent frame, m/s. grid: the frozen encoder's embedding of the occupancy crop.
angular: 1 - r / r_max of the angular pedestrian grid, so that an empty cone is 0.
"""

_NEGATIVE_SLOPE = 0.1
"""Of a projection below zero: the auto-encoder's latent is linear, a ReLU would lose half of it."""


@dataclass(frozen=True)
class ChannelWidths(Settings):
    """Units of one input channel: its fully connected projection, and its LSTM."""

    projection: Annotated[int, In(UNITS)]
    lstm: Annotated[int, In(UNITS)]


@dataclass(frozen=True)
class LstmSettings(Settings):
    """Settings of a `MotionLstm`.

    Attributes:
        channels: input channel -> widths; the network does not read the others.
        joint: units of the LSTM that fuses the channels.
        head: units of the fully connected layer before the output.
        residual: the output is added to the tracked velocity.
        dropout: probability that a unit in front of the head is dropped in training.
        uncertainty: "none", or a key of `UNCERTAINTIES`.
    """

    channels: Mapping[str, ChannelWidths]
    joint: Annotated[int, In(UNITS)]
    head: Annotated[int, In(UNITS)]
    residual: bool
    dropout: Annotated[float, In("[0, 1)")] = 0.0
    uncertainty: str = "none"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("uncertainty", self.uncertainty, ("none", *UNCERTAINTIES))
        unknown = sorted(set(self.channels) - set(CHANNELS))
        if unknown or not self.channels:
            raise ValueRuleError("channels", unknown, f"known channels are {CHANNELS}")

    @classmethod
    def parse(cls, plain: Mapping[str, Any]) -> LstmSettings:
        """Build from plain dictionaries; the joint LSTM reads the channels in the order of `CHANNELS`."""
        settings: LstmSettings = load(cls, plain)
        order = sorted(settings.channels, key=CHANNELS.index)
        return replace(settings, channels={name: settings.channels[name] for name in order})

    def plain(self) -> dict[str, Any]:
        """The inverse of `parse`."""
        return asdict(self)

    @property
    def channels_read(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(self.channels)

    def build(self, widths: Mapping[str, int], horizon_steps: int) -> MotionLstm:
        """A network with random weights."""
        return MotionLstm(self, widths, horizon_steps)


class MotionLstm(ForecastNetwork):
    """A projection and an LSTM per channel, a joint LSTM, a head that gives the next P velocities.

    Its outputs are "velocities" [..., P, 2], agent frame, m/s, and, unless `uncertainty` is "none", the
    "spread" (a, c, k) of `GaussianHead`, [..., P, 3].
    """

    settings: LstmSettings

    def __init__(self, settings: LstmSettings, widths: Mapping[str, int], horizon_steps: int):
        super().__init__(settings, widths, horizon_steps)
        self.projections = nn.ModuleDict()
        self.lstms = nn.ModuleDict()
        for name, units in settings.channels.items():
            self.projections[name] = nn.Linear(widths[name], units.projection)
            self.lstms[name] = nn.LSTM(units.projection, units.lstm, batch_first=True)
        fused = sum(units.lstm for units in settings.channels.values())
        self.joint = nn.LSTM(fused, settings.joint, batch_first=True)
        self.dropout = nn.Dropout(settings.dropout)
        self.head = nn.Linear(settings.joint, settings.head)
        self.out = nn.Linear(settings.head, 2 * horizon_steps)
        # Last, so that the random weights before it are those of a network without it.
        self.uncertainty = (
            UNCERTAINTIES[settings.uncertainty](settings.joint, horizon_steps)
            if settings.uncertainty != "none"
            else None
        )

    @property
    def state_shapes(self) -> dict[str, tuple[int, ...]]:
        """A hidden and a cell state per LSTM."""
        units = {name: widths.lstm for name, widths in self.settings.channels.items()}
        units["joint"] = self.settings.joint
        return {f"{name}_{part}": (n,) for name, n in units.items() for part in ("hidden", "cell")}

    def forward(self, inputs: Mapping[str, Tensor], state: Tensors) -> tuple[Tensors, Tensors]:
        """Forecast after every step; see `ForecastNetwork.forward`."""
        after: Tensors = {}

        def advance(name: str, lstm: nn.Module, values: Tensor) -> Tensor:
            before = state[f"{name}_hidden"][None], state[f"{name}_cell"][None]
            outputs, (hidden, cell) = lstm(values, before)
            after[f"{name}_hidden"], after[f"{name}_cell"] = hidden[0], cell[0]
            return outputs

        channels = []
        for name, lstm in self.lstms.items():
            projected = leaky_relu(self.projections[name](inputs[name]), _NEGATIVE_SLOPE)
            channels.append(advance(name, lstm, projected))
        fused = advance("joint", self.joint, torch.cat(channels, dim=-1))
        head = torch.relu(self.head(self.dropout(fused)))
        velocities = self.out(head).unflatten(-1, (self.horizon_steps, 2))
        if self.settings.residual:
            velocities = velocities + inputs["state"][..., None, :]
        outputs = {"velocities": velocities}
        if self.uncertainty is not None:
            outputs["spread"] = self.uncertainty(fused)
        return outputs, after

    def loss(self, outputs: Tensors, future: Tensor, known: Tensor, dt_s: float) -> Loss:
        """Mean distance of velocities (eq. 5), and the negative log likelihood of the positions.

        The likelihood takes the mean as given, so it trains the spread alone. Weight decay, the
        regularisation term of the equation, is the optimiser's.
        """
        velocity = mean_over(velocity_distance(outputs["velocities"], future), known)
        total = velocity
        if "spread" in outputs:
            error = displacements(outputs["velocities"].detach(), future, dt_s)
            total = total + mean_over(negative_log_density(error, outputs["spread"]), known)
        return Loss(total, velocity, known.sum())

    @property
    def score_names(self) -> tuple[str, ...]:
        """Displacement, and the likelihood where there is a spread."""
        return ("ade_m",) if self.uncertainty is None else ("ade_m", "nll")

    def scores(self, outputs: Tensors, future: Tensor, dt_s: float) -> Tensors:
        """Displacement, m; and the negative log likelihood of the positions, nats. [..., P] each."""
        error = displacements(outputs["velocities"], future, dt_s)
        scores = {"ade_m": torch.linalg.vector_norm(error, dim=-1)}
        if "spread" in outputs:
            scores["nll"] = negative_log_density(error, outputs["spread"])
        return scores

    def decode(self, outputs: Tensors, dt_s: float) -> Tensors:
        """Velocities, and the covariance of the single mode."""
        decoded = {"velocities": outputs["velocities"]}
        if "spread" in outputs:
            decoded["covariance"] = covariance_of(outputs["spread"]).unsqueeze(-4)
        return decoded

    def clipped_groups(self) -> list[list[nn.Parameter]]:
        """Weights of the mean and of the spread: with one norm, the spread would slow the mean down."""
        spread = [] if self.uncertainty is None else list(self.uncertainty.parameters())
        apart = {id(weight) for weight in spread}
        return [[weight for weight in self.parameters() if id(weight) not in apart], spread]

    def take_encoder(self, encoder: nn.Module) -> None:
        """The encoder's fully connected layer becomes the projection of the grid (paper, III-B.2)."""
        assert isinstance(encoder, GridEncoder)
        if "grid" in self.projections:
            self.projections["grid"].load_state_dict(encoder.fc.state_dict())
