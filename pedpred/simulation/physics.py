"""Compiled physics of walking that both simulators and the robot's planner share.

`simulation.kernel` moves people in rooms, `simulation.worlds.walking` those of all other worlds.
"""

from __future__ import annotations

import math

from pedpred.compiled import compiled

SMALLEST_AXIS_M = 1e-3  # lower bound of b and |r|: the gradient is undefined at the foci of the ellipse


@compiled
def _corner(x, y, origin, resolution_m, shape_x, shape_y):
    """Lower cell and weights of the bilinear interpolation at (x, y); constant beyond the centres."""
    u = min(max((x - origin[0]) / resolution_m - 0.5, 0.0), shape_x - 1.0)
    v = min(max((y - origin[1]) / resolution_m - 0.5, 0.0), shape_y - 1.0)
    i, j = min(int(u), shape_x - 2), min(int(v), shape_y - 2)
    return i, j, u - i, v - j


@compiled
def _blend(values, i, j, p, q):
    """Bilinear mean of the four values around a point; in a grid of one cell i = -1 is this cell, too."""
    low = (1.0 - q) * values[i, j] + q * values[i, j + 1]
    high = (1.0 - q) * values[i + 1, j] + q * values[i + 1, j + 1]
    return (1.0 - p) * low + p * high


@compiled
def value_at(grid, origin, cell_m, x, y):
    """Interpolate a grid bilinearly at a point in the world; constant beyond the outermost centres."""
    i, j, p, q = _corner(x, y, origin, cell_m, grid.shape[0], grid.shape[1])
    return _blend(grid, i, j, p, q)


@compiled
def border(x, y, ground):
    """Distance to the nearest obstacle point of a `Ground`, m, and its gradient."""
    shape = ground.distance.shape
    i, j, p, q = _corner(x, y, ground.origin, ground.resolution_m, shape[0], shape[1])
    away_x = _blend(ground.away[:, :, 0], i, j, p, q)
    away_y = _blend(ground.away[:, :, 1], i, j, p, q)
    return _blend(ground.distance, i, j, p, q), away_x, away_y


@compiled
def way(x, y, goal, routes):
    """Unit vector of the desired direction to a goal of `Routes`; straight to it where the field is 0."""
    shape = routes.direction.shape
    i, j, p, q = _corner(x, y, routes.origin, routes.resolution_m, shape[1], shape[2])
    field = routes.direction[goal]
    e_x, e_y = unit(_blend(field[:, :, 0], i, j, p, q), _blend(field[:, :, 1], i, j, p, q))
    if e_x == 0.0 and e_y == 0.0:
        return unit(routes.target[goal, 0] - x, routes.target[goal, 1] - y)
    return e_x, e_y


@compiled
def unit(x, y):
    """Unit vector; 0 for vectors shorter than 1e-9."""
    length = math.sqrt(x * x + y * y)
    if length < 1e-9:
        return 0.0, 0.0
    return x / length, y / length


@compiled
def ellipse_axis(near_m, far_m, stride_m2):
    """Semi-minor axis b, m, 2b = sqrt((|r| + |r - y|)^2 - |y|^2). Helbing & Molnar 1995, eq. 4.

    Args:
        near_m: |r|, distance to the other pedestrian.
        far_m: |r - y|, distance to where its stride y ends.
        stride_m2: |y|^2.
    """
    return 0.5 * math.sqrt(max((near_m + far_m) ** 2 - stride_m2, 4.0 * SMALLEST_AXIS_M**2))
