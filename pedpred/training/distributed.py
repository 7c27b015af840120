"""The device and the process group of a training.

Processes started by `torchrun` divide the lanes of one joint batch. Gradients are averaged over known
targets, so each process is weighted by the targets it has. For networks with a memory and without dropout,
the result is that of one process with all lanes. For networks without a memory, each process masks inputs and
balances errors for its own rows alone, so the trained weights depend on the number of processes.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import Annotated

import torch
import torch.distributed as dist
from torch import Tensor

from pedpred.errors import ValueRuleError
from pedpred.models.contract import Tensors
from pedpred.settings import In, Settings, check_choice

_LOG = logging.getLogger(__name__)
DEVICES = ("auto", "cpu", "cuda")
_BFLOAT16_UNITS = ("amx_bf16", "avx512_bf16")
_ENVIRONMENT = {"RANK": 0, "WORLD_SIZE": 1, "LOCAL_RANK": 0}  # set by torchrun; defaults without it


@dataclass(frozen=True, kw_only=True)
class ThreadSettings(Settings):
    """How many threads compute.

    Attributes:
        threads: of torch; weights depend on their number.
    """

    threads: Annotated[int, In("[1, 1024]")]


@dataclass(frozen=True, kw_only=True)
class DeviceSettings(ThreadSettings):
    """Where and how precisely a network is trained.

    Attributes:
        device: "cpu", "cuda", or "auto": CUDA where there is one.
        autocast: matrix products in bfloat16; "auto" asks the device, see `multiplies_bfloat16`.
    """

    device: str = "auto"
    autocast: bool | str = "auto"

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_place(self.device, self.autocast)


def _check_place(device: str, autocast: bool | str) -> None:
    check_choice("device", device, DEVICES)
    if not isinstance(autocast, bool) and autocast != "auto":
        raise ValueRuleError("autocast", autocast, "use true, false or auto")


@dataclass(frozen=True)
class DistributedContext:
    """One process of a training.

    Attributes:
        device: where network and data live.
        autocast: matrix products in bfloat16; weights and sums stay float32.
        rank: index of this process; process 0 writes the files.
        size: number of processes.
    """

    device: torch.device
    autocast: bool = False
    rank: int = 0
    size: int = 1

    @property
    def writes(self) -> bool:
        """Whether this process writes files and shows progress."""
        return self.rank == 0

    def precision(self) -> AbstractContextManager:
        """A context for the forward pass."""
        return torch.autocast(self.device.type, torch.bfloat16) if self.autocast else nullcontext()

    def share(self, count: int, field: str = "lanes") -> slice:
        """This process's share of the lanes or rows of a batch; `field`: the setting of their number.

        Raises:
            ValueRuleError: they cannot be divided evenly.
        """
        if count % self.size:
            rule = f"it must be a multiple of the number of processes, {self.size}"
            raise ValueRuleError(field, count, rule)
        each = count // self.size
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

    def gather_state(self, state: Tensors) -> Tensors:
        """The recurrent state of all lanes, from every process's share. [N, ...] each."""
        return state if self.size == 1 else {name: self._all(value) for name, value in state.items()}

    def own_state(self, state: Tensors) -> Tensors:
        """This process's share of the state of all lanes: the inverse of `gather_state`."""
        return {name: value[self.share(len(value))] for name, value in state.items()}

    def _all(self, part: Tensor) -> Tensor:
        parts = [torch.empty_like(part) for _ in range(self.size)]
        dist.all_gather(parts, part.contiguous())
        return torch.cat(parts)


ALONE = DistributedContext(torch.device("cpu"))
"""One process on the CPU."""


def multiplies_bfloat16(device: torch.device) -> bool:
    """Whether a device has units for products in bfloat16; without them, they are slower than float32."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported(including_emulation=False)
    processor: dict = getattr(torch.cpu, "get_capabilities", dict)()  # unknown to older versions of torch
    return any(processor.get(unit, False) for unit in _BFLOAT16_UNITS)


@contextmanager
def distributed_context(device: str, autocast: bool | str) -> Iterator[DistributedContext]:
    """The context of this process, from the environment that `torchrun` sets; `ALONE` without it.

    Args:
        device: see `DeviceSettings`.
        autocast: likewise.

    Raises:
        ValueRuleError: the device is unknown or missing, or `autocast` is none of these.
    """
    _check_place(device, autocast)
    there = torch.cuda.is_available()
    if device == "cuda" and not there:
        raise ValueRuleError("device", device, "no CUDA device is visible; use auto or cpu")
    rank, size, local = (int(os.environ.get(k, d)) for k, d in _ENVIRONMENT.items())
    chosen = torch.device("cpu") if device == "cpu" or not there else torch.device("cuda", local)
    narrow = multiplies_bfloat16(chosen) if autocast == "auto" else bool(autocast)
    _LOG.info("training on %s, products in %s", chosen, "bfloat16" if narrow else "float32")
    here = DistributedContext(chosen, narrow, rank, size)
    if chosen.type == "cuda":
        torch.cuda.set_device(chosen)
    if size > 1:
        dist.init_process_group("nccl" if chosen.type == "cuda" else "gloo")
    try:
        yield here
    finally:
        if size > 1:
            dist.destroy_process_group()
