"""Whole tracks, divided into training and validation, and streamed by lanes into truncated batches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pedpred.datasets.rows import TrainingRows
from pedpred.errors import ValueRuleError
from pedpred.settings import In, OneOf, Settings


@dataclass(frozen=True, kw_only=True)
class SplitSettings(Settings):
    """How sequences are divided into those to learn from and those to choose the weights by.

    Attributes:
        validation_by: what the split keeps whole, "scene" or "track".
        validation_share: share of the data kept for validation; at least one scene or track.
    """

    validation_by: Annotated[str, OneOf(("scene", "track"))]
    validation_share: Annotated[float, In("[0, 1)")]


def split_sequences(
    data: TrainingRows, how: SplitSettings, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Divide the sequences of a data set.

    Args:
        data: the data set.
        how: by "scene" splits by arrangement, by "track" by track (with all its phases); both with all
            variants of the scene.
        rng: decides which.

    Returns:
        Rows [first, last) of the training and of the validation sequences. [S, 2] each

    Raises:
        ValueRuleError: the data set has only one scene or track to divide.
    """
    by = how.validation_by
    group = data.spans.scene if by == "scene" else data.spans.track
    names = rng.permutation(np.unique(group))
    held = max(1, round(how.validation_share * len(names)))
    if held >= len(names):
        rule = f"the data have {len(names)} of it: nothing is left to train on"
        raise ValueRuleError("validation_by", by, rule)
    validation = np.isin(group, names[:held])
    return data.spans.rows[~validation], data.spans.rows[validation]


@dataclass(frozen=True)
class LaneBatch:
    """One sub-sequence of every lane.

    Attributes:
        rows: rows of the data set; -1 pads behind the end of a track. [B, L]
        starts: a track starts here, so the lane's state is reset first. [B] bool
        chance: uniform numbers in [0, 1), drawn where a track starts and held along it. [B, 3] float32
    """

    rows: np.ndarray
    starts: np.ndarray
    chance: np.ndarray


def cut(sequences: np.ndarray, longest: int, rng: np.random.Generator) -> np.ndarray:
    """Cut long sequences into pieces of at most `longest` steps, at a random phase. [S, 2] -> [R, 2]."""
    pieces = []
    for first, last in sequences:
        if last - first <= longest:
            pieces.append(np.array([[first, last]]))
            continue
        edges = np.arange(first + rng.integers(1, longest + 1), last, longest)
        edges = np.concatenate([[first], edges, [last]])
        pieces.append(np.stack([edges[:-1], edges[1:]], axis=-1))
    return np.concatenate(pieces)


def stream_lanes(
    sequences: np.ndarray, lanes: int, length: int, longest: int, rng: np.random.Generator
) -> Iterator[LaneBatch]:
    """Endless batches: pass after pass over all sequences, shuffled and cut anew each time.

    Args:
        sequences: rows [first, last) of each track. [S, 2]
        lanes: number of lanes B.
        length: steps of a sub-sequence L (the truncation depth).
        longest: a track is cut into pieces of at most this many steps.
        rng: order of the tracks, phase of the cuts, and chance.
    """
    queue: list[tuple[int, int]] = []
    position, end = np.zeros(lanes, dtype=np.int64), np.zeros(lanes, dtype=np.int64)
    chance = np.zeros((lanes, 3), dtype=np.float32)
    while True:
        starts = position >= end
        for lane in np.flatnonzero(starts):
            if not queue:
                pieces = cut(sequences, longest, rng)
                queue = [(int(a), int(b)) for a, b in pieces[rng.permutation(len(pieces))]]
            position[lane], end[lane] = queue.pop()
            chance[lane] = rng.random(3, dtype=np.float32)
        rows = position[:, None] + np.arange(length)
        yield LaneBatch(np.where(rows < end[:, None], rows, -1), starts, chance.copy())
        position += length
