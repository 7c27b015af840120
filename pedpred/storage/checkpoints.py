"""Weights on disk: safetensors beside a JSON description. No pickle is ever read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

from pedpred.errors import StorageError

_REMEDY = "Train it again (dvc repro)"


def write_checkpoint(folder: Path, weights: dict[str, torch.Tensor], about: dict[str, Any]) -> None:
    """Write `weights.safetensors` and `about.json` (what the network is, how it reads its inputs)."""
    folder.mkdir(parents=True, exist_ok=True)
    save_file({k: v.detach().cpu().contiguous() for k, v in weights.items()}, folder / "weights.safetensors")
    (folder / "about.json").write_text(json.dumps(about, indent=1, sort_keys=True) + "\n")


def read_checkpoint(folder: Path) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """Read weights and description.

    Raises:
        StorageError: a file is missing or damaged.
    """
    try:
        weights = load_file(folder / "weights.safetensors")
    except (OSError, SafetensorError) as cause:
        raise StorageError(folder / "weights.safetensors", "file", str(cause), _REMEDY) from cause
    try:
        about = json.loads((folder / "about.json").read_text())
    except (OSError, ValueError) as cause:
        raise StorageError(folder / "about.json", "file", str(cause), _REMEDY) from cause
    return weights, about


def load_weights(module: torch.nn.Module, weights: dict[str, torch.Tensor], folder: Path) -> None:
    """Put weights into a module.

    Raises:
        StorageError: names or shapes do not fit, which means the configuration has changed.
    """
    try:
        module.load_state_dict(weights)
    except RuntimeError as cause:
        problem = " ".join(str(cause).split())[:300]
        raise StorageError(folder / "weights.safetensors", "weights", problem, _REMEDY) from cause
