"""What a model says about its inputs: `pedpred.models` has one implementation for each kind of network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from pedpred.features.surroundings import Surroundings
from pedpred.scenes import OccupancyMap


@dataclass(frozen=True)
class StoredColumn:
    """What a column looks like on disk: type, trailing axes, unit and frame."""

    dtype: str
    shape: tuple[int, ...] = ()
    unit: str = ""


class ModelFeatures(Protocol):
    """Sizes of a model's inputs, and how these are computed: the same code offline, in batches and online.

    Attributes:
        has_memory: the network is trained on all steps of tracks; otherwise on single instants.
    """

    has_memory: ClassVar[bool]

    def columns(self) -> dict[str, StoredColumn]:
        """The inputs in rows for training, in the order of their columns."""

    def compute(self, seen: Surroundings, dt_s: float) -> dict[str, np.ndarray]:
        """Compute the inputs of some people, as they are stored.

        Args:
            seen: the people and what is around them. [Q]
            dt_s: time step of the forecasts, s.

        Returns:
            Column -> [Q, ...]
        """

    def obstacle_inputs(
        self, occupancy: OccupancyMap, position: np.ndarray, heading_rad: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Compute those of the inputs that show the map.

        Args:
            occupancy: static obstacles.
            position: where it is seen from, world frame, m. [Q, 2]
            heading_rad: of the agent frames. [Q]
        """

    def channels(self, stored: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """What a network reads, but for what a frozen encoder computes: channel -> [Q, width].

        Args:
            stored: of `compute`, or columns of a file.
        """

    def empty_channels(self) -> dict[str, float]:
        """Value of each channel where nobody and nothing is near, but for those where it is 0."""

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Inputs of an exported network: name -> shape per person."""

    def graph_inputs(self, stored: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Inputs of an exported network from those of `compute`. [Q, ...] float32 each."""

    def past_s(self, dt_s: float) -> float:
        """How far back they look, s; 0 without any past."""
