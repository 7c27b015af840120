"""Weights on disk: safetensors beside a JSON description. No pickle is ever read."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import load_file, save

from pedpred.errors import InputError
from pedpred.files import atomic_write, read_json, translate_errors, write_text

_REMEDY = "Train the network again"


def write_checkpoint(folder: Path, weights: dict[str, torch.Tensor], about: dict[str, Any]) -> None:
    """Write `weights.safetensors` and `about.json` (settings, widths of the inputs)."""
    with atomic_write(folder / "weights.safetensors") as new:
        new.write_bytes(save({k: v.detach().cpu().contiguous() for k, v in weights.items()}))
    write_text(folder / "about.json", json.dumps(about, indent=1, sort_keys=True) + "\n")


def read_checkpoint(folder: Path) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """Read weights and description.

    Raises:
        InputError: a file is missing or damaged.
    """
    path = folder / "weights.safetensors"
    with translate_errors(partial(InputError, path, "file", remedy=_REMEDY)):
        weights = load_file(path)
    about = folder / "about.json"
    return weights, read_json(about, partial(InputError, about, "file", remedy=_REMEDY))


def load_weights(module: torch.nn.Module, weights: dict[str, torch.Tensor], folder: Path) -> None:
    """Make weights those of a module, which may have none yet (device "meta").

    Raises:
        InputError: names or shapes do not fit the settings.
    """
    with translate_errors(partial(InputError, folder / "weights.safetensors", "weights", remedy=_REMEDY)):
        module.load_state_dict(weights, assign=True)
