"""Candidate goals: what is known of a room's goals before any motion is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.errors import ShapeError, ValueRuleError
from pedpred.scenes import OccupancyMap, Scene
from pedpred.simulation.ground import ground_of
from pedpred.simulation.layouts import open_cells, scattered


@dataclass(frozen=True)
class Candidates:
    """Equally likely places that may be goals.

    Attributes:
        position: world frame, m. [G, 2]
        spread_m: a goal may lie this far from the candidate that stands for it; 0 = it is the candidate.
    """

    position: np.ndarray
    spread_m: float

    def __post_init__(self) -> None:
        if self.position.ndim != 2 or self.position.shape[1] != 2:
            raise ShapeError("position", self.position.shape, "(G, 2)")
        if not self.spread_m >= 0:
            raise ValueRuleError("spread_m", self.spread_m, "it must not be negative")


def room_goals(scene: Scene) -> Candidates:
    """Collect the room's own targets: the goals of all people in the recording.

    Raises:
        ValueRuleError: the recording knows no goals, so there is no pool.
    """
    if scene.trajectories.goal is None:
        raise ValueRuleError(
            "trajectories.goal", None, f"scene '{scene.name}' has no pool of goals to infer from"
        )
    return Candidates(np.unique(scene.trajectories.goal, axis=0), 0.0)


def draw_candidates(
    occupancy: OccupancyMap, clearance_m: float, count: int, rng: np.random.Generator
) -> Candidates:
    """Draw places as the simulator draws targets, in a room of which only the map is known.

    As the simulator draws a room's targets: from all walkable cells, none close to another. Each stands for
    its share of the walkable ground, a disc of radius h = sqrt(A / (G pi)), which is also their spacing.
    A few drawn rooms confine targets to regions, which a map does not show; this is ignored.

    Args:
        occupancy: the map.
        clearance_m: free ground around a target.
        count: G, at least 1 (fewer are found where there are fewer cells).
        rng: of the draw.

    Raises:
        ValueRuleError: no candidate is asked for, or the map has no walkable ground.
    """
    if count < 1:
        raise ValueRuleError("candidates", count, "it must be at least 1")
    cells = open_cells(ground_of(occupancy), clearance_m)
    if not len(cells):
        raise ValueRuleError("occupancy", "no walkable cell", f"goals need {clearance_m} m of clearance")
    spread_m = float(np.sqrt(len(cells) * occupancy.resolution_m**2 / (np.pi * count)))
    return Candidates(scattered(cells, count, spread_m, rng), spread_m)
