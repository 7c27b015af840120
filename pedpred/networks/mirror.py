"""Left and right exchanged: channels that a network reads, and what it answers, in the agent frame."""

from __future__ import annotations

from collections.abc import Mapping

from torch import Tensor

from pedpred.networks.contract import Tensors


def mirrored_inputs(inputs: Mapping[str, Tensor]) -> Tensors:
    """The channels of a world whose left and right are exchanged. [N, width] each."""
    left = {"state": (1.0, -1.0), "history": (1.0, -1.0, 1.0), "track": (1.0, -1.0, 1.0, 1.0, 1.0, 1.0)}
    left["neighbours"] = (1.0, -1.0, 1.0, -1.0, 1.0)
    mirrored = {name: _times(inputs[name], sign) for name, sign in left.items()}
    mirrored["beams"] = inputs["beams"].flip(-1).roll(1, -1)  # beam 0 points along the heading
    return mirrored


def mirrored_outputs(outputs: Tensors) -> Tensors:
    """What the outputs in a mirrored world mean in the world."""
    left = {"velocities": (1.0, -1.0), "modes": (1.0, -1.0), "weight": (1.0,), "spread": (1.0, 1.0, -1.0)}
    return {name: outputs[name] * outputs[name].new_tensor(sign) for name, sign in left.items()}


def _times(values: Tensor, sign: tuple[float, ...]) -> Tensor:
    """Rows of len(sign) numbers side by side, each number times its sign. [N, width]."""
    return (values.unflatten(-1, (-1, len(sign))) * values.new_tensor(sign)).flatten(-2)
