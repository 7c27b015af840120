"""How far a training is, on disk, so that an interrupted one goes on where it was."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from safetensors import safe_open
from safetensors.torch import save
from torch import Tensor

from pedpred.errors import ValueRuleError
from pedpred.files import SCRATCH, atomic_write
from pedpred.training.distributed import ALONE, DistributedContext

if TYPE_CHECKING:
    from pedpred.training.loop import Learner


@dataclass
class Progress:
    """How far a training is.

    Attributes:
        step: steps done.
        best: weights of the best validation so far, where they are kept.
        curve: one row per validation.
    """

    step: int = 0
    best: dict[str, Tensor] = field(default_factory=dict)
    curve: list[dict[str, float]] = field(default_factory=list)

    def lowest(self, figure: str) -> float:
        """Smallest value of a validation figure so far."""
        return min((row[figure] for row in self.curve), default=float("inf"))


@contextmanager
def scratch_folder(
    about: Mapping[str, Any],
    weights: Mapping[str, Tensor] | None = None,
    context: DistributedContext = ALONE,
) -> Iterator[Path]:
    """The folder of an unfinished training, removed when the training has ended.

    A training that ended with an error of its settings would end with it again, so its folder goes, too.

    Args:
        about: plain values that identify the training: settings and data.
        weights: the initial ones, which identify it too, unless `about` implies them.
        context: only the process that writes files removes the folder.
    """
    digest = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
    for tensor in (weights or {}).values():
        digest.update(tensor.numpy().tobytes())
    folder = SCRATCH / "training" / digest.hexdigest()[:16]
    try:
        yield folder
    except ValueRuleError:
        _remove(folder, context)
        raise
    _remove(folder, context)


def _remove(folder: Path, context: DistributedContext) -> None:
    if context.writes:
        shutil.rmtree(folder, ignore_errors=True)


def save_progress(folder: Path | None, progress: Progress, learner: Learner) -> None:
    """Write everything into `folder`, replacing the old state at once. All processes must call it."""
    if folder is None:
        return
    memory = learner.context.gather_state(learner.memory)
    if not learner.context.writes:
        return
    tensors = {f"network.{k}": v for k, v in learner.network.state_dict().items()}
    tensors |= {f"best.{k}": v for k, v in progress.best.items()}
    tensors |= {f"memory.{k}": v for k, v in memory.items()}
    for index, moments in learner.optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{k}": v for k, v in moments.items()}
    about = {"about": json.dumps({"step": progress.step, "curve": progress.curve})}
    with atomic_write(folder / "progress.safetensors") as new:
        new.write_bytes(save({k: v.clone().contiguous() for k, v in tensors.items()}, about))


def load_progress(folder: Path | None, learner: Learner) -> Progress | None:
    """Put the learner back to where `folder` says; None when there is nothing."""
    path = None if folder is None else folder / "progress.safetensors"
    if path is None or not path.exists():
        return None
    with safe_open(path, "pt", device=str(learner.context.device)) as file:
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118, not a mapping
        about = json.loads(file.metadata()["about"])
    learner.network.load_state_dict(_under(tensors, "network."))
    moments: dict[int, dict[str, Tensor]] = {}
    for key, value in _under(tensors, "optimizer.").items():
        index, _, name = key.partition(".")
        moments.setdefault(int(index), {})[name] = value
    learner.optimizer.load_state_dict({**learner.optimizer.state_dict(), "state": moments})
    learner.memory = learner.context.own_state(_under(tensors, "memory."))
    return Progress(about["step"], _under(tensors, "best."), about["curve"])


def _under(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}
