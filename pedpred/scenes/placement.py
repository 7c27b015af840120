"""Does the map lie under the people? A flipped or shifted one doubles errors, and nothing else tells."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np

from pedpred.scenes.occupancy import OccupancyMap
from pedpred.scenes.scene import Scene

MOST_MISPLACED = 0.01
"""A larger share of detections in obstacles or outside the map is warned about."""
SURELY_MISPLACED = 0.05
"""Above this share, figures with the map say little; they are marked."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Placement:
    """Where on the map the detections of a scene are.

    Attributes:
        in_obstacles: share of the detections in occupied cells; 0 if there are none.
        outside: share outside the map.
    """

    in_obstacles: float
    outside: float

    def __str__(self) -> str:
        shares = f"{100 * self.in_obstacles:.1f} % of the detections in obstacles"
        return f"{shares}, {100 * self.outside:.1f} % outside the map"

    @property
    def worst(self) -> float:
        """The larger share."""
        return max(self.in_obstacles, self.outside)

    @property
    def wrong(self) -> bool:
        """Whether so many detections are misplaced that the map can hardly be right."""
        return self.worst > SURELY_MISPLACED


def placement(position: np.ndarray, occupancy: OccupancyMap) -> Placement:
    """Measure where on a map detections are.

    Args:
        position: of the detections, world frame, m. [M, 2]
        occupancy: the map.
    """
    if not len(position):
        return Placement(0.0, 0.0)
    cells = occupancy.cell_of(position)
    outside = ((cells < 0) | (cells >= occupancy.occupied.shape)).any(axis=-1)
    return Placement(float(occupancy.is_occupied(position).mean()), float(outside.mean()))


def checked_placement(scene: Scene) -> Placement:
    """Measure where on its map the detections of a scene are; log a warning where that is implausible."""
    position, ground = scene.trajectories.position, scene.occupancy
    placed = placement(position, ground)
    if placed.worst <= MOST_MISPLACED:
        return placed
    turned = {
        "mirrored in x": replace(ground, occupied=ground.occupied[::-1]),
        "mirrored in y": replace(ground, occupied=ground.occupied[:, ::-1]),
        "turned by 180 degrees": replace(ground, occupied=ground.occupied[::-1, ::-1]),
        "with x and y swapped": replace(ground, occupied=ground.occupied.T, origin=ground.origin[::-1]),
    }
    others = {how: placement(position, other) for how, other in turned.items()}
    best = min(others, key=lambda how: others[how].worst)
    hint = f" With the map {best}: {others[best]}." if others[best].worst <= MOST_MISPLACED else ""
    _log.warning(
        "%s%s: %s. The map does not lie under the people, and such a map doubles errors silently. Draw both; "
        "origin is the map's lower left corner in metres, the first row of its picture is its largest y.%s",
        "WRONG MAP? " if placed.wrong else "",
        scene.name,
        placed,
        hint,
    )
    return placed
