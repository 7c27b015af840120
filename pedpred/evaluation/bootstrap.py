"""Intervals of means over windows, by resampling whole tracks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class TrackBootstrap:
    """Replicates of a pool of windows; one draw serves all metrics.

    Windows of one track are not independent; tracks nearly are.

    Attributes:
        track: index of each window's track. [W]
        weight: how often each track occurs in each replicate. [S, T]
    """

    track: np.ndarray
    weight: np.ndarray

    @classmethod
    def draw(cls, track: np.ndarray, samples: int, rng: np.random.Generator) -> TrackBootstrap:
        """Draw `samples` replicates of the tracks of some windows [W]."""
        names, index = np.unique(track, return_inverse=True)
        count = len(names)
        return cls(index, rng.multinomial(count, np.full(count, 1.0 / max(count, 1)), size=samples))

    @property
    def tracks(self) -> int:
        """Number of tracks T."""
        return self.weight.shape[1]

    def interval(self, values: np.ndarray) -> tuple[float, float]:
        """Find the 95 % interval of the mean over the windows that have a value.

        Args:
            values: one per window, NaN where there is none. [W]
        """
        valid = ~np.isnan(values)
        if not valid.any():
            return float("nan"), float("nan")
        sums = np.bincount(self.track[valid], weights=values[valid], minlength=self.tracks)
        counts = np.bincount(self.track[valid], minlength=self.tracks)
        total = self.weight @ counts
        some = total > 0
        low, high = np.percentile((self.weight @ sums)[some] / total[some], [2.5, 97.5])
        return float(low), float(high)
