"""Tracks streamed by lanes into truncated batches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np


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
