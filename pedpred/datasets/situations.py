"""Training rows of networks without memory: single situations, mapped from disk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pedpred.errors import ValueRuleError
from pedpred.features import FeatureSettings
from pedpred.features.situation import channel_widths
from pedpred.storage.mapped import MappedRows
from pedpred.storage.situations import read_situations, read_situations_manifest

_COMMON_SIZES = (
    "dt_s", "horizon_steps", "history_steps", "neighbours", "neighbour_range_m", "beams", "beam_range_m",
)  # fmt: skip


@dataclass(frozen=True)
class SituationData:
    """Rows of some sets, set by set, and within a set world by world.

    Attributes:
        channels: name -> [M, width], see `features.situation`; single or half precision.
        future: true velocities, agent frame, m/s; all are known. [M, P, 2] float32
        worlds: set -> rows [first, last) of each of its worlds or viewings. [S, 2]
        sizes: of the features.
    """

    channels: dict[str, torch.Tensor]
    future: torch.Tensor
    worlds: dict[str, np.ndarray]
    sizes: FeatureSettings

    def to(self, device: torch.device) -> SituationData:
        """The same rows on another device, all of them."""
        channels = {name: values.to(device) for name, values in self.channels.items()}
        return SituationData(channels, self.future.to(device), self.worlds, self.sizes)

    def inputs(self, rows: torch.Tensor) -> dict[str, torch.Tensor]:
        """The network's inputs at some rows, channel -> [B, width] float32."""
        return {name: values[rows].to(torch.float32) for name, values in self.channels.items()}


def load_situations(folders: Mapping[str, Path]) -> SituationData:
    """All rows of some sets; they lie on disk (`MappedRows`).

    Args:
        folders: set -> its folder; all of the same sizes.

    Raises:
        StorageError: a file is missing or damaged.
        ValueRuleError: the sets were made with different sizes.
        OSError: the disk is full.
    """
    found = {name: read_situations_manifest(folder) for name, folder in folders.items()}
    (first, (sizes, _)), *others = found.items()
    for name, (own, _) in others:
        for size in _COMMON_SIZES:
            if getattr(own, size) != getattr(sizes, size):
                rule = f"{first} has {getattr(sizes, size)!r}, and one training needs the same"
                raise ValueRuleError(f"{name}, {size}", getattr(own, size), rule)
    columns = {name: MappedRows(name) for name in (*channel_widths(sizes), "future")}
    spans: dict[str, list[tuple[int, int]]] = {name: [] for name in folders}
    for name, (_, worlds) in found.items():
        for world in worlds:
            before = len(columns["future"])
            for column, values in read_situations(folders[name], world, sizes).items():
                columns[column].append(values)
            spans[name].append((before, len(columns["future"])))
    tensors = {name: torch.from_numpy(rows.array()) for name, rows in columns.items()}
    future = tensors.pop("future")
    return SituationData(tensors, future, {k: np.array(v).reshape(-1, 2) for k, v in spans.items()}, sizes)


def held_out(worlds: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Which worlds of a set are kept for validation; at least one stays for training. [S] bool."""
    chosen = np.zeros(len(worlds), bool)
    chosen[rng.permutation(len(worlds))[: min(round(share * len(worlds)), len(worlds) - 1)]] = True
    return chosen
