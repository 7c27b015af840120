"""A network of that input set: a transformer whose tokens are the person and the neighbours."""

from dataclasses import asdict, dataclass
from typing import Annotated, ClassVar

import torch
from torch import nn

from pedpred.models.contract import ForecastNetwork, Loss, displacements, mean_over, velocity_distance
from pedpred.settings import In, Settings, load


@dataclass(frozen=True)
class ToySettings(Settings):
    units: Annotated[int, In("[1, 1024]")] = 32
    channels_read: ClassVar[tuple[str, ...]] = ("velocity", "own", "others")

    @classmethod
    def parse(cls, plain):
        return load(cls, plain)

    def plain(self):
        return asdict(self)

    def build(self, widths, horizon_steps):
        return ToyNetwork(self, widths, horizon_steps)


class ToyNetwork(ForecastNetwork):
    """Constant velocity, and a correction from everybody's last positions. Its only output: velocities."""

    state_shapes: ClassVar = {}  # it has no memory
    score_names: ClassVar = ("ade_m",)

    def __init__(self, settings, widths, horizon_steps):
        super().__init__(settings, widths, horizon_steps)
        units = settings.units
        self.token = nn.Linear(widths["own"], units)
        self.attention = nn.Linear(units, 3 * units)
        self.layers = nn.Sequential(nn.Linear(units, units), nn.ReLU(), nn.Linear(units, 2 * horizon_steps))

    def forward(self, inputs, state):
        people = torch.cat([inputs["own"], inputs["others"]], -1).unflatten(-1, (-1, self.widths["own"]))
        token, nobody = self.token(people), people[..., None, :, 2] == 0.0
        query, key, value = self.attention(token).chunk(3, dim=-1)
        alike = query @ key.transpose(-1, -2) / self.settings.units**0.5
        seen = token + alike.masked_fill(nobody, -1e4).softmax(-1) @ value
        change = self.layers(seen[..., 0, :]).unflatten(-1, (self.horizon_steps, 2))
        return {"velocities": inputs["velocity"][..., None, :] + change}, {}

    def loss(self, outputs, future, known, dt_s):
        loss = mean_over(velocity_distance(outputs["velocities"], future), known)
        return Loss(loss, loss, known.sum())

    def scores(self, outputs, future, dt_s):
        return {"ade_m": displacements(outputs["velocities"], future, dt_s).norm(dim=-1)}

    def decode(self, outputs, dt_s):
        return outputs
