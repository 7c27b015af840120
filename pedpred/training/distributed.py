"""Where a training runs: on which device, and beside which other processes.

Processes that `torchrun` starts divide the lanes of one joint batch. They learn what one process with all
lanes would: gradients are averages over known targets, so each process weighs as many as it has.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass

import torch
import torch.distributed as dist
from torch import Tensor

from pedpred.errors import ConfigError
from pedpred.networks.lstm import MotionState

DEVICES = ("auto", "cpu", "cuda")
_PLACE = {"RANK": 0, "WORLD_SIZE": 1, "LOCAL_RANK": 0}  # what torchrun sets, and what holds without it


@dataclass(frozen=True)
class DistributedContext:
    """One process of a training.

    Attributes:
        device: where network and data live.
        autocast: matrix products in bfloat16; CUDA only.
        rank: which process this is, 0 being the one that writes files.
        size: how many there are.

    Raises:
        ConfigError: bfloat16 is asked for on a CPU, where it is slower than float32.
    """

    device: torch.device
    autocast: bool = False
    rank: int = 0
    size: int = 1

    def __post_init__(self) -> None:
        if self.autocast and self.device.type != "cuda":
            raise ConfigError("training.autocast", True, "needs training.device=cuda; set it to false")

    @property
    def writes(self) -> bool:
        """Whether this process writes files and shows progress."""
        return self.rank == 0

    def precision(self) -> AbstractContextManager:
        """A context for the forward pass."""
        return torch.autocast(self.device.type, torch.bfloat16) if self.autocast else nullcontext()

    def share(self, lanes: int) -> slice:
        """This process's part of so many lanes.

        Raises:
            ConfigError: they cannot be divided evenly.
        """
        if lanes % self.size:
            raise ConfigError(
                "training.*.lanes", lanes, f"use a multiple of the number of processes, {self.size}"
            )
        each = lanes // self.size
        return slice(self.rank * each, (self.rank + 1) * each)

    def total(self, values: Tensor) -> Tensor:
        """Sum over the processes. [...] -> [...]."""
        if self.size > 1:
            dist.all_reduce(values)
        return values

    def average(self, parameters: Iterable[Tensor], loss: Tensor, weight: Tensor) -> Tensor:
        """Make all processes' gradients those of the joint loss, sum_i w_i l_i / sum_i w_i, in one exchange.

        Args:
            parameters: with this process's gradients, which are replaced.
            loss: mean over this process's targets. []
            weight: how many they are, w_i. []

        Returns:
            The joint loss. []
        """
        if self.size == 1:
            return loss
        gradients = [p.grad for p in parameters if p.grad is not None]
        parts = [*(g.flatten() for g in gradients), loss[None], torch.ones_like(loss)[None]]
        joint = self.total(torch.cat(parts) * weight)
        joint /= joint[-1].clamp(min=1)
        for gradient, part in zip(gradients, joint.split([len(p) for p in parts])[:-2], strict=True):
            gradient.copy_(part.view_as(gradient))
        return joint[-2]

    def gathered(self, state: MotionState) -> MotionState:
        """The memory of all lanes, from every process's share."""
        if self.size == 1:
            return state
        return MotionState({k: (self._lanes(h), self._lanes(c)) for k, (h, c) in state.memory.items()})

    def mine(self, state: MotionState) -> MotionState:
        """This process's share of the memory of all lanes: the inverse of `gathered`."""
        lanes = self.share(next(iter(state.memory.values()))[0].shape[1])
        return MotionState({k: (h[:, lanes], c[:, lanes]) for k, (h, c) in state.memory.items()})

    def _lanes(self, part: Tensor) -> Tensor:
        parts = [torch.empty_like(part) for _ in range(self.size)]
        dist.all_gather(parts, part.contiguous())
        return torch.cat(parts, dim=1)


ALONE = DistributedContext(torch.device("cpu"))
"""One process on the CPU."""


@contextmanager
def distributed_context(device: str, autocast: bool) -> Iterator[DistributedContext]:
    """This process's place, as `torchrun` tells it through the environment; alone without it.

    Args:
        device: "cpu", "cuda", or "auto": CUDA where there is one.
        autocast: see `DistributedContext`.

    Raises:
        ConfigError: the device is unknown or not there.
    """
    if device not in DEVICES:
        raise ConfigError("training.device", device, f"use one of {DEVICES}")
    there = torch.cuda.is_available()
    if device == "cuda" and not there:
        raise ConfigError("training.device", device, "no CUDA device is visible; use auto or cpu")
    rank, size, local = (int(os.environ.get(k, d)) for k, d in _PLACE.items())
    chosen = torch.device("cpu") if device == "cpu" or not there else torch.device("cuda", local)
    here = DistributedContext(chosen, autocast, rank, size)
    if chosen.type == "cuda":
        torch.cuda.set_device(chosen)
    if size > 1:
        dist.init_process_group("nccl" if chosen.type == "cuda" else "gloo")
    try:
        yield here
    finally:
        if size > 1:
            dist.destroy_process_group()
