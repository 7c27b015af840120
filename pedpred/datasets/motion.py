"""All rows of a data set, mapped from disk, and the tracks that run through them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pedpred.errors import StorageError
from pedpred.features import FeatureSettings, FeatureTable
from pedpred.storage.mapped import MappedRows
from pedpred.storage.shards import read_embeddings, read_manifest, read_shard_blocks

NETWORK_COLUMNS = ("velocity", "angular", "future", "future_steps")


@dataclass(frozen=True)
class MotionData:
    """Inputs and targets of a data set, ready to be looked up by row.

    Attributes:
        velocity: agent frame, m/s. [M, 2] float32
        angular: 1 - r / r_max of the angular pedestrian grid. [M, K] float32
        future: targets, agent frame, m/s. [M, P, 2] float32
        future_steps: known steps of each target. [M] int64
        embedding: frozen encoder's output, where it was asked for; half precision from disk. [M, C]
        empty_code: the encoder's output of a crop without obstacles; zeros when it is not given. [C] float32
        sequences: rows [first, last) of each (scene, track, clock). [S, 2]
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

    def to(self, device: torch.device) -> MotionData:
        """The same rows on another device, all of them."""
        tensors = {k: v.to(device) for k, v in vars(self).items() if isinstance(v, torch.Tensor)}
        return MotionData(**vars(self) | tensors)

    def inputs(
        self, rows: torch.Tensor, instead: Mapping[str, torch.Tensor] | None = None
    ) -> dict[str, torch.Tensor]:
        """The network's inputs at some rows, [...] -> channel -> [..., width].

        Args:
            rows: row < 0 stands still, sees nobody and no obstacle. [...]
            instead: channel -> rows that this channel is looked up at instead. [...]
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
    """Rows [first, last) of each (track, clock) of a sorted feature table. [S, 2]."""
    first = np.flatnonzero(table.step == 0)
    return (
        np.stack([first, np.append(first[1:], len(table))], axis=-1) if len(first) else np.zeros((0, 2), int)
    )


def load_motion_data(features: Path, embeddings: Path | None) -> MotionData:
    """All shards of a feature folder, with the encoder's outputs when a folder is given.

    Rows come block by block and lie on disk (`MappedRows`); only the sequences take memory.

    Raises:
        StorageError: a shard or manifest cannot be read, or features and embeddings do not belong together.
        OSError: the disk is full.
    """
    settings, shards = read_manifest(features)
    scenes = {digest: index for index, digest in enumerate(dict.fromkeys(shards.values()))}
    columns = {name: MappedRows(name) for name in NETWORK_COLUMNS}
    embedding = MappedRows("embedding")
    sequences, scene, track = [], [], []
    rows = 0
    for name, digest in shards.items():
        begin = rows
        for table in read_shard_blocks(features, name, settings):
            spans = sequences_of(table)
            sequences.append(spans + rows)
            scene.append(np.full(len(spans), scenes[digest]))
            track.append(table.track_id[spans[:, 0]])
            for column, values in network_columns(table, settings).items():
                columns[column].append(values)
            rows += len(table)
        if embeddings is not None:
            embedding.extend(read_embeddings(embeddings, name))
            if len(embedding) != rows:
                problem = f"{len(embedding) - begin} rows beside {rows - begin} rows of features"
                raise StorageError(
                    embeddings / f"{name}.parquet", "embedding", problem, "Encode it again (dvc repro)"
                )
    return MotionData(
        **{name: torch.from_numpy(column.array()) for name, column in columns.items()},
        embedding=None if embeddings is None else torch.from_numpy(embedding.array()),
        sequences=np.concatenate(sequences),
        scene=np.concatenate(scene),
        track=np.concatenate(track),
        dt_s=settings.dt_s,
    )


def network_columns(table: FeatureTable, settings: FeatureSettings) -> dict[str, np.ndarray]:
    """What the network needs of a feature table: `NETWORK_COLUMNS`."""
    return {
        "velocity": table.velocity,
        "angular": 1.0 - table.angular_grid / np.float32(settings.max_range_m),
        "future": table.future.copy(),
        "future_steps": table.future_steps.astype(np.int64),
    }
