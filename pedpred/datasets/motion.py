"""The rows of a data set, mapped from disk, and its tracks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pedpred.errors import StorageError, ValueRuleError
from pedpred.features import FeatureSettings, FeatureTable
from pedpred.storage.mapped import MappedRows
from pedpred.storage.shards import read_embeddings, read_manifest, read_shard_blocks

NETWORK_COLUMNS = ("velocity", "angular", "future", "future_steps")
_COMMON_SIZES = ("dt_s", "horizon_steps", "grid_cells", "grid_resolution_m", "angular_cells", "max_range_m")


@dataclass(frozen=True)
class MotionData:
    """Inputs and targets of a data set, ready to be looked up by row.

    Attributes:
        velocity: agent frame, m/s. [M, 2] float32
        angular: 1 - r / r_max of the angular pedestrian grid. [M, K] float32
        future: targets, agent frame, m/s. [M, P, 2] float32
        future_steps: known steps of each target. [M] int64
        embedding: frozen encoder's output, if a network reads it; half precision from disk. [M, C]
        empty_embedding: the encoder's output of a crop without obstacles; zeros if None. [C] float32
        sequences: rows [first, last) of each (scene, track, phase). [S, 2]
        scene: index of the scene that each sequence belongs to; its variants share it. [S]
        track: id of the track that each sequence belongs to; variants of a scene share it. [S]
        dt_s: time between steps, s.
    """

    velocity: torch.Tensor
    angular: torch.Tensor
    future: torch.Tensor
    future_steps: torch.Tensor
    embedding: torch.Tensor | None
    sequences: np.ndarray
    scene: np.ndarray
    track: np.ndarray
    dt_s: float
    empty_embedding: torch.Tensor | None = None

    @property
    def widths(self) -> dict[str, int]:
        """Channel -> numbers per step, of the channels that are here."""
        tables = {"state": self.velocity, "grid": self.embedding, "angular": self.angular}
        return {name: table.shape[1] for name, table in tables.items() if table is not None}

    @property
    def horizon_steps(self) -> int:
        """Forecast steps P."""
        return self.future.shape[1]

    def to(self, device: torch.device) -> MotionData:
        """The same rows on another device, all of them."""
        tensors = {k: v.to(device) for k, v in vars(self).items() if isinstance(v, torch.Tensor)}
        return MotionData(**vars(self) | tensors)

    def inputs(
        self, rows: torch.Tensor, instead: Mapping[str, torch.Tensor] | None = None
    ) -> dict[str, torch.Tensor]:
        """The network's inputs at some rows, channel -> [..., width].

        Args:
            rows: row < 0 stands for a person at rest without neighbours or obstacles. [...]
            instead: channel -> other rows for this channel. [...]
        """
        tables: dict[str, tuple[torch.Tensor, torch.Tensor | None]]
        tables = {"state": (self.velocity, None), "angular": (self.angular, None)}
        if self.embedding is not None:
            tables["grid"] = (self.embedding, self.empty_embedding)
        instead = instead or {}
        return {
            name: _entries(table, instead.get(name, rows), nothing)
            for name, (table, nothing) in tables.items()
        }

    def known(self, rows: torch.Tensor) -> torch.Tensor:
        """Which target steps count at some rows, [...] -> [..., P]; none at row < 0."""
        steps = torch.arange(self.future.shape[1], device=rows.device)
        return (steps < self.future_steps[rows.clamp(min=0)][..., None]) & (rows >= 0)[..., None]


def _entries(table: torch.Tensor, rows: torch.Tensor, nothing: torch.Tensor | None) -> torch.Tensor:
    """Entries of a table [M, W]; at row < 0 `nothing` [W], which is zeros when None. [...] -> [..., W]."""
    found = table.index_select(0, rows.clamp(min=0).flatten()).to(torch.float32).unflatten(0, rows.shape)
    return torch.where((rows >= 0)[..., None], found, 0.0 if nothing is None else nothing)


def sequences_of(table: FeatureTable) -> np.ndarray:
    """Rows [first, last) of each (track, phase) of a sorted feature table. [S, 2]."""
    first = np.flatnonzero(table.step == 0)
    return (
        np.stack([first, np.append(first[1:], len(table))], axis=-1) if len(first) else np.zeros((0, 2), int)
    )


def network_inputs(
    table: FeatureTable, settings: FeatureSettings, embeddings: np.ndarray | None
) -> dict[str, torch.Tensor]:
    """The network's inputs at every row of a table, channel -> [M, width].

    Args:
        table: of some instants.
        settings: that it was made with.
        embeddings: the encoder's outputs of its crops, not rounded. [M, C] float32
    """
    found = {"state": table.velocity, "angular": _closeness(table, settings), "grid": embeddings}
    return {name: torch.from_numpy(values.copy()) for name, values in found.items() if values is not None}


def load_motion_data(features: Sequence[Path], embeddings: Sequence[Path] | None = None) -> MotionData:
    """All shards of one or more feature folders, with the encoder's outputs where their folders are given.

    Rows are read block by block and lie on disk (`MappedRows`); only the sequences take memory.

    Args:
        features: folders, of one place or set of scenes each; their sizes must be the same.
        embeddings: the folder that belongs to each of them.

    Raises:
        StorageError: a shard or manifest cannot be read, or features and embeddings do not belong together.
        ValueRuleError: the folders were made with different sizes.
        OSError: the disk is full.
    """
    rows = _Rows()
    sizes = [read_manifest(folder)[0] for folder in features]
    encoded: Sequence[Path | None] = embeddings or [None] * len(features)
    for folder, own, part in zip(features, encoded, sizes, strict=True):
        first = sizes[0]
        for name in _COMMON_SIZES:
            if getattr(part, name) != getattr(first, name):
                rule = f"{features[0]} has {getattr(first, name)!r}, and one training needs the same"
                raise ValueRuleError(f"{folder}, {name}", getattr(part, name), rule)
        rows.add_folder(folder, own)
    return MotionData(
        **{name: torch.from_numpy(column.array()) for name, column in rows.columns.items()},
        embedding=None if embeddings is None else torch.from_numpy(rows.embedding.array()),
        sequences=np.concatenate(rows.sequences),
        scene=np.concatenate(rows.scene),
        track=np.concatenate(rows.track),
        dt_s=sizes[0].dt_s,
    )


class _Rows:
    """Rows and sequences of feature folders, as they are read."""

    def __init__(self) -> None:
        self.columns = {name: MappedRows(name) for name in NETWORK_COLUMNS}
        self.embedding = MappedRows("embedding")
        self.sequences: list[np.ndarray] = []
        self.scene: list[np.ndarray] = []
        self.track: list[np.ndarray] = []
        self._rows = self._scenes = self._tracks = 0

    def add_folder(self, features: Path, embeddings: Path | None) -> None:
        """Append all shards of a folder; its scenes and tracks are none of the folders before."""
        settings, shards = read_manifest(features)
        scenes = {digest: self._scenes + i for i, digest in enumerate(dict.fromkeys(shards.values()))}
        largest = -1
        for name, digest in shards.items():
            for table in read_shard_blocks(features, name, settings):
                spans = sequences_of(table)
                self.sequences.append(spans + self._rows)
                self.scene.append(np.full(len(spans), scenes[digest]))
                track = table.track_id[spans[:, 0]]
                self.track.append(track + self._tracks)
                largest = max(largest, int(track.max(initial=-1)))
                for column, values in network_columns(table, settings).items():
                    self.columns[column].append(values)
                self._rows += len(table)
            if embeddings is not None:
                self._add_embeddings(embeddings, name)
        self._scenes += len(scenes)
        self._tracks += largest + 1

    def _add_embeddings(self, folder: Path, name: str) -> None:
        self.embedding.extend(read_embeddings(folder, name))
        if len(self.embedding) != self._rows:
            problem = f"{len(self.embedding)} rows so far beside {self._rows} rows of features"
            raise StorageError(folder / f"{name}.parquet", "embedding", problem, "Encode the features again")


def network_columns(table: FeatureTable, settings: FeatureSettings) -> dict[str, np.ndarray]:
    """The columns of `NETWORK_COLUMNS` from a feature table."""
    return {
        "velocity": table.velocity,
        "angular": _closeness(table, settings),
        "future": table.future.copy(),
        "future_steps": table.future_steps.astype(np.int64),
    }


def _closeness(table: FeatureTable, settings: FeatureSettings) -> np.ndarray:
    """1 - r / r_max of the angular pedestrian grid. [M, K] float32."""
    return 1.0 - table.angular_grid / np.float32(settings.max_range_m)
