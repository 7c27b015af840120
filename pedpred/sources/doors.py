"""Doors in walls that are lines: what of a wall is left beside them."""

from __future__ import annotations

import numpy as np
import shapely

from pedpred.errors import ValueRuleError

_ASIDE_M = 0.01  # a door this far from a wall still lies in it
_MOST_CUTS = 100_000


def cut_doors(lines: np.ndarray, doors: np.ndarray, needed: bool = False) -> np.ndarray:
    """Open walls where doors lie in them; a door in a gap changes nothing.

    Args:
        lines: walls, from end to end, m. [S, 2, 2]
        doors: likewise. [D, 2, 2]
        needed: each door must open a wall.

    Returns:
        What is left of the walls. [S', 2, 2]

    Raises:
        ValueRuleError: a door that is needed opens no wall, or there are absurdly many doors in walls.
    """
    if not len(doors):
        return lines
    left, cuts = shapely.linestrings(lines), 0
    tree = shapely.STRtree(left)
    openings = shapely.buffer(shapely.linestrings(doors), _ASIDE_M, cap_style="flat")
    for door, opening in zip(doors, openings, strict=True):
        along = tree.query(opening, predicate="intersects") if not opening.is_empty else np.zeros(0, int)
        if (cuts := cuts + len(along)) > _MOST_CUTS:
            raise ValueRuleError("doors", len(doors), f"they may lie in at most {_MOST_CUTS} walls")
        shorter = shapely.difference(left[along], opening)
        if needed and not (shapely.length(shorter) < shapely.length(left[along]) - 2 * _ASIDE_M).any():
            raise ValueRuleError("open_ends", door.tolist(), "it must lie on a wall")
        left[along] = shorter
    points, piece = shapely.get_coordinates(shapely.get_parts(left), return_index=True)
    same = piece[1:] == piece[:-1]
    return np.stack([points[:-1][same], points[1:][same]], axis=1)
