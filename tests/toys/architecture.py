"""An architecture of two modes, as somebody would add it: one file, and one line in the registry."""

import dataclasses

import torch
from torch import nn

from pedpred.models.contract import ForecastNetwork, Loss, mean_over, velocity_distance


@dataclasses.dataclass(frozen=True)
class ToySettings:
    units: int
    channels_read: tuple = ("state",)

    @classmethod
    def parse(cls, plain):
        return cls(plain["units"], tuple(plain.get("channels_read", ("state",))))

    def plain(self):
        return dataclasses.asdict(self)

    def build(self, widths, horizon_steps):
        return ToyNetwork(self, widths, horizon_steps)


class ToyNetwork(ForecastNetwork):
    """A state of one tensor with two axes; the second mode stands still, and is the more likely one."""

    score_names = ("distance",)

    def __init__(self, settings, widths, horizon_steps):
        super().__init__(settings, widths, horizon_steps)
        self.read = nn.Linear(sum(self.widths.values()), settings.units)
        self.out = nn.Linear(settings.units, 2 * horizon_steps)

    @property
    def state_shapes(self):
        return {"trace": (1, self.settings.units)}

    def forward(self, inputs, state):
        trace, outputs = state["trace"][:, 0], []
        for values in torch.cat([inputs[name] for name in self.widths], -1).unbind(1):
            trace = torch.tanh(self.read(values) + 0.5 * trace)
            outputs.append(self.out(trace).unflatten(-1, (self.horizon_steps, 2)))
        return {"velocities": torch.stack(outputs, 1)}, {"trace": trace[:, None]}

    def loss(self, outputs, future, known, dt_s):
        loss = mean_over(velocity_distance(outputs["velocities"], future), known)
        return Loss(loss, loss, known.sum())

    def scores(self, outputs, future, dt_s):
        return {"distance": velocity_distance(outputs["velocities"], future)}

    def decode(self, outputs, dt_s):
        velocities = outputs["velocities"]
        path = torch.cumsum(velocities * dt_s, dim=-2)
        modes = torch.stack([path, 0.0 * path], dim=-3)
        weight = 0.0 * velocities[..., 0, :] + torch.tensor([1.0, 2.0])
        return {"velocities": velocities, "path": modes, "weight": weight}
