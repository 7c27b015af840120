"""A killed training goes on where it was: everything that changes from step to step, on disk."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import load_file, save_file

from pedpred.files import atomic_write
from pedpred.networks.lstm import MotionLstm, MotionState
from pedpred.training.distributed import DistributedContext


@dataclass
class Progress:
    """Where a training stands.

    Attributes:
        step: steps done.
        curve: one row per validation.
        best: weights of the best validation so far.
        state: recurrent memory of the lanes.
    """

    step: int
    state: MotionState
    best: dict[str, torch.Tensor] = field(default_factory=dict)
    curve: list[dict[str, float]] = field(default_factory=list)

    @property
    def best_ade_m(self) -> float:
        """Smallest validation error so far, m."""
        return min((row["validation_ade_m"] for row in self.curve), default=float("inf"))


def save_progress(
    folder: Path,
    progress: Progress,
    network: MotionLstm,
    optimizer: torch.optim.Optimizer,
    context: DistributedContext,
) -> None:
    """Write everything into `folder`; the old state is replaced in one move. All processes must call it."""
    state = context.gathered(progress.state)
    if not context.writes:
        return
    tensors = {f"network.{k}": v for k, v in network.state_dict().items()}
    tensors |= {f"best.{k}": v for k, v in progress.best.items()}
    for name, pair in state.memory.items():
        tensors |= {f"state.{name}.{i}": part for i, part in enumerate(pair)}
    for index, moments in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{k}": v for k, v in moments.items()}
    about = {"about": json.dumps({"step": progress.step, "curve": progress.curve})}
    with atomic_write(folder / "progress.safetensors") as new:
        save_file({k: v.detach().clone().contiguous() for k, v in tensors.items()}, new, metadata=about)


def load_progress(
    folder: Path, network: MotionLstm, optimizer: torch.optim.Optimizer, context: DistributedContext
) -> Progress | None:
    """Put network and optimiser back to where `folder` says; None when there is nothing."""
    path = folder / "progress.safetensors"
    if not path.exists():
        return None
    tensors = load_file(path, device=str(context.device))
    network.load_state_dict(_under(tensors, "network."))
    moments: dict[int, dict[str, torch.Tensor]] = {}
    for key, value in _under(tensors, "optimizer.").items():
        index, _, name = key.partition(".")
        moments.setdefault(int(index), {})[name] = value
    optimizer.load_state_dict({**optimizer.state_dict(), "state": moments})
    parts = _under(tensors, "state.")
    memory = {k[:-2]: (parts[k[:-2] + ".0"], parts[k[:-2] + ".1"]) for k in parts if k.endswith(".0")}
    about: dict[str, Any] = _metadata(path)
    state = context.mine(MotionState(memory))
    return Progress(about["step"], state, _under(tensors, "best."), about["curve"])


def _under(tensors: Mapping[str, torch.Tensor], prefix: str) -> dict[str, torch.Tensor]:
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}


def _metadata(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        size = int.from_bytes(file.read(8), "little")
        return json.loads(json.loads(file.read(size))["__metadata__"]["about"])
