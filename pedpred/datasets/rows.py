"""The training rows of some sets, mapped from disk: inputs, targets, and which rows belong together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import torch

from pedpred.errors import InputError, ValueRuleError, shape_error
from pedpred.models.features import RowFormat
from pedpred.models.lstm.encoding import EMBEDDED
from pedpred.rows.files import read_embeddings, read_manifest, read_shard
from pedpred.storage.mapped import MappedRows

_NO_TRACK = np.zeros(0, np.int64)


@dataclass(frozen=True)
class Spans:
    """Rows that belong together: the steps of a track, or all instants of a world.

    Attributes:
        rows: [first, last) of each. [S, 2]
        part: index of its set. [S]
        scene: index of its scene or world; variants of a scene share it. [S]
        track: id of its track; variants of a scene share it. 0 for worlds. [S]
    """

    rows: np.ndarray
    part: np.ndarray
    scene: np.ndarray
    track: np.ndarray

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True)
class TrainingRows:
    """Inputs and targets of some sets, ready to be looked up by row.

    Attributes:
        channels: what a network reads, name -> [M, width]; single or half precision.
        future: true velocities, agent frame, m/s. [M, P, 2] float32
        future_steps: how many of them are known. [M] int64
        spans: rows that belong together.
        sets: names of the sets, in the order of their rows.
        row_format: protocol and sizes.
        empty: channel -> its values where nobody and nothing is near, zeros for others. [width] float32
    """

    channels: Mapping[str, torch.Tensor]
    future: torch.Tensor
    future_steps: torch.Tensor
    spans: Spans
    sets: tuple[str, ...]
    row_format: RowFormat
    empty: Mapping[str, torch.Tensor] = field(default_factory=dict)

    @property
    def widths(self) -> dict[str, int]:
        """Channel -> numbers per row."""
        return {name: values.shape[1] for name, values in self.channels.items()}

    @property
    def horizon_steps(self) -> int:
        """Forecast steps P."""
        return self.future.shape[1]

    @property
    def dt_s(self) -> float:
        """Time between steps, s."""
        return self.row_format.protocol.dt_s

    @property
    def by_set(self) -> dict[str, np.ndarray]:
        """Set -> rows [first, last) of its spans. [S, 2] each."""
        return {name: self.spans.rows[self.spans.part == i] for i, name in enumerate(self.sets)}

    def to(self, device: torch.device) -> TrainingRows:
        """The same rows on another device, all of them."""
        channels, empty = (
            {name: values.to(device) for name, values in tensors.items()}
            for tensors in (self.channels, self.empty)
        )
        future, future_steps = self.future.to(device), self.future_steps.to(device)
        return replace(self, channels=channels, empty=empty, future=future, future_steps=future_steps)

    def inputs(
        self, rows: torch.Tensor, instead: Mapping[str, torch.Tensor] | None = None
    ) -> dict[str, torch.Tensor]:
        """The network's inputs at some rows, channel -> [..., width] float32.

        Args:
            rows: row < 0 stands for a person at rest without neighbours or obstacles. [...]
            instead: channel -> other rows for this channel. [...]
        """
        instead = instead or {}
        return {
            name: _entries(table, instead.get(name, rows), self.empty.get(name))
            for name, table in self.channels.items()
        }

    def known(self, rows: torch.Tensor) -> torch.Tensor:
        """Which target steps count at some rows, [...] -> [..., P]; none at row < 0."""
        steps = torch.arange(self.future.shape[1], device=rows.device)
        return (steps < self.future_steps[rows.clamp(min=0)][..., None]) & (rows >= 0)[..., None]


def _entries(table: torch.Tensor, rows: torch.Tensor, empty: torch.Tensor | None) -> torch.Tensor:
    """Entries of a table [M, W]; at row < 0 `empty` [W], which is zeros when None. [...] -> [..., W]."""
    entries = table.index_select(0, rows.clamp(min=0).flatten()).to(torch.float32).unflatten(0, rows.shape)
    return torch.where((rows >= 0)[..., None], entries, 0.0 if empty is None else empty)


def sequences_of(step: np.ndarray) -> np.ndarray:
    """Rows [first, last) of each track, whose steps count from 0. [M] -> [S, 2]."""
    first = np.flatnonzero(step == 0)
    last = np.append(first[1:], len(step))
    return np.stack([first, last], axis=-1) if len(first) else np.zeros((0, 2), int)


def load_rows(folders: Mapping[str, Path], embeddings: Mapping[str, Path] | None = None) -> TrainingRows:
    """All rows of some sets, with an encoder's outputs where they are given.

    Rows are read block by block and lie on disk (`MappedRows`); only the spans take memory.

    Args:
        folders: set -> its folder; of the same protocol and sizes.
        embeddings: set -> the frozen encoder's outputs there, the channel "grid".

    Raises:
        InputError: a file or manifest cannot be read, or rows and embeddings do not belong together.
        ValueRuleError: the sets were made with different sizes.
        OSError: the disk is full.
    """
    manifests = {name: read_manifest(folder) for name, folder in folders.items()}
    row_format = _common({name: row_format for name, (row_format, _) in manifests.items()})
    columns, scenes, tracks = _Columns(row_format), 0, 0
    for part, (name, folder) in enumerate(folders.items()):
        _, shards = manifests[name]
        numbers = {scene: scenes + i for i, scene in enumerate(dict.fromkeys(shards.values()))}
        largest = -1
        for shard, scene in shards.items():
            for block in read_shard(folder, shard, row_format):
                columns.add(block, part, numbers[scene], tracks)
                largest = max(largest, int(block.get("track_id", _NO_TRACK).max(initial=-1)))
            if embeddings is not None:
                _add_embeddings(columns, embeddings[name], shard)
        scenes += len(numbers)
        tracks += largest + 1
    return columns.join(tuple(folders))


def _common(formats: Mapping[str, RowFormat]) -> RowFormat:
    """What several sets were made with.

    Raises:
        ValueRuleError: they were made with different sizes.
    """
    first, *others = formats
    common = [("protocol", "dt_s"), ("protocol", "horizon_steps")]
    common += [("features", size) for size in vars(formats[first].features)]
    for other in others:
        mine, theirs = (formats[name] for name in (first, other))
        for part, size in common:
            values = [getattr(getattr(row_format, part), size, None) for row_format in (mine, theirs)]
            if values[0] != values[1]:
                rule = f"{first} has {values[0]!r}, and one training needs the same"
                raise ValueRuleError(f"{other}, {size}", values[1], rule)
    return formats[first]


class _Columns:
    """Rows and spans, as they are read."""

    def __init__(self, row_format: RowFormat) -> None:
        self.row_format = row_format
        self.mapped: dict[str, MappedRows] = {}
        self.spans: list[tuple[np.ndarray, ...]] = []

    def __len__(self) -> int:
        return len(self.mapped["future"]) if self.mapped else 0

    def add(self, block: Mapping[str, np.ndarray], part: int, scene: int, tracks: int) -> None:
        """Append a block of one scene; ids of its tracks begin at `tracks`."""
        future, known = block["future"], block.get("future_steps")
        if "step" in block:
            spans = sequences_of(block["step"])
            track = block["track_id"][spans[:, 0]] + tracks
        else:
            spans, track = np.array([[0, len(future)]]), np.zeros(1, int)
        each = np.full((2, len(spans)), [[part], [scene]])
        self.spans.append((spans + len(self), *each, track))
        known = np.full(len(future), future.shape[1]) if known is None else known
        rows = {"future": future, "future_steps": known.astype(np.int64)}
        for name, values in {**self.row_format.features.channels(block), **rows}.items():
            self.extend(name, values)

    def extend(self, name: str, values: np.ndarray) -> None:
        """Append to one column."""
        self.mapped.setdefault(name, MappedRows(name)).append(values)

    def join(self, sets: tuple[str, ...]) -> TrainingRows:
        """Everything that was added.

        Raises:
            ValueRuleError: nothing was.
        """
        if not self.mapped:
            raise shape_error("future", (), "at least one block of rows")
        tensors = {name: torch.from_numpy(rows.array()) for name, rows in self.mapped.items()}
        future, future_steps = tensors.pop("future"), tensors.pop("future_steps")
        spans = Spans(*(np.concatenate(column) for column in zip(*self.spans, strict=True)))
        return TrainingRows(tensors, future, future_steps, spans, sets, self.row_format)


def _add_embeddings(columns: _Columns, folder: Path, shard: str) -> None:
    for block in read_embeddings(folder, shard):
        columns.extend(EMBEDDED, block)
    count = len(columns.mapped[EMBEDDED]) if EMBEDDED in columns.mapped else 0
    if count != len(columns):
        problem = f"{count} rows so far beside {len(columns)} rows of features"
        raise InputError(folder / f"{shard}.parquet", "embedding", problem, "Encode the features again")
