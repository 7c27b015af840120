"""From a picture of the obstacles to a grid on the ground."""

from __future__ import annotations

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.geometry import Homography
from pedpred.scenes import OccupancyMap

_MOST_CELLS = 4_000_000


def occupancy_from_image(
    blocked: np.ndarray, homography: Homography, points: np.ndarray, resolution_m: float, margin_m: float
) -> OccupancyMap:
    """Project an obstacle image onto the ground by inverse warp.

    The centre of each cell is looked up in the nearest pixel; outside the image is free. The map covers
    all obstacles and all given points, and its origin is a multiple of the resolution.

    Args:
        blocked: which pixels show an obstacle. [rows, columns] bool
        homography: image (row, column) <-> world.
        points: places that the map must cover, world frame, m. [M, 2]
        resolution_m: side of a cell, m.
        margin_m: ground kept around everything, m.

    Raises:
        ValueRuleError: the map would be absurdly large.
    """
    covered = np.concatenate([points, homography.to_world(np.argwhere(blocked))])
    with np.errstate(invalid="ignore", over="ignore"):  # what is infinitely far is refused below
        first = np.floor((covered.min(axis=0) - margin_m) / resolution_m)
        shape = np.ceil((covered.max(axis=0) + margin_m) / resolution_m) - first
        cells, size = shape.prod(), (shape * resolution_m).round(1).tolist()
    if not cells <= _MOST_CELLS:
        raise ValueRuleError("map size [m]", size, f"it may have at most {_MOST_CELLS} cells")
    occupancy = OccupancyMap(np.zeros(shape.astype(int), dtype=bool), first * resolution_m, resolution_m)
    centers = occupancy.center_of(np.moveaxis(np.indices(occupancy.occupied.shape), 0, -1))
    pixels = np.rint(homography.to_image(centers))
    inside = ((pixels >= 0) & (pixels < blocked.shape)).all(axis=-1)
    rows, columns = np.where(inside[..., None], pixels, 0).astype(np.int64).transpose(2, 0, 1)
    return OccupancyMap(inside & blocked[rows, columns], occupancy.origin, resolution_m)
