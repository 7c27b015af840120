"""Irregular forces, and grounds and routes without a map, for values by hand."""

import math

import numpy as np

from pedpred.simulation.ground import Ground
from pedpred.simulation.routing import Routes
from pedpred.simulation.settings import ForceSettings

FORCES = ForceSettings(
    relaxation_time_s=0.6,
    speed_cap=1.25,
    pedestrian_strength=2.3,
    pedestrian_range_m=0.35,
    anticipation_s=0.8,
    border_strength=7.0,
    border_range_m=0.25,
    sight_cosine=math.cos(math.radians(100.0)),
    unseen_weight=0.5,
    group_gaze=4.0,
    group_attraction=3.0,
    group_repulsion=1.7,
    group_distance_m=0.8,
)


def ground_of(field, origin=(0.0, 0.0), cell_m=0.5, occupied=None):
    blocked = np.zeros(field.shape[:2], bool) if occupied is None else occupied
    return Ground(np.array(origin), cell_m, blocked, field[..., 0], field[..., 1:])


OPEN = ground_of(np.full((2, 2, 3), [1e3, 0.0, 0.0]))
"""No obstacle is near."""


def routes_along(*directions, target=None):
    """The same direction everywhere, for each target."""
    field = np.array(directions, np.float32)[:, None, None] * np.ones((1, 2, 2, 1), np.float32)
    far = 1e6 * np.array(directions)
    return Routes(far if target is None else np.array(target, float), np.zeros(2), 0.5, field)
