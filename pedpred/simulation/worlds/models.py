"""The walking model of a world: social forces or the collision-free speed model, with drawn parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from pedpred.settings import In, Range, Settings
from pedpred.simulation.worlds.drawing import LogUniform, Uniform, draw_fields


@dataclass(frozen=True)
class ModelSettings(Settings):
    """Ranges of the parameters of `WalkingModel`, each with its law, and shares of the models.

    Attributes:
        collision_free_share: share of the sparse worlds with the collision-free speed model.
        dense_collision_free_share: share of the dense worlds with it.
        published_share: share of the worlds with social forces that have the parameters of Helbing &
            Molnar 1995.
        strength: V0 of pedestrian repulsion, m^2/s^2.
        range_m: sigma of pedestrian repulsion.
        anticipation_s: of the strides of others.
        border_strength: U0 of border repulsion, m^2/s^2.
        border_range_m: R of border repulsion.
        unseen_weight: factor on the influence of people behind.
        direction_push: a of the collision-free speed model.
        direction_range_m: D of the collision-free speed model.
        wall_push: a of walls in the collision-free speed model.
        wall_range_m: D of walls in the collision-free speed model.
        noise_mps2: standard deviation of the random acceleration.
        wander_rad: standard deviation of the direction.
        wander_s: its correlation time.
        unsteady: standard deviation of the desired speed over time, as a share of it.
    """

    collision_free_share: Annotated[float, In("[0, 1]")]
    dense_collision_free_share: Annotated[float, In("[0, 1]")]
    published_share: Annotated[float, In("[0, 1]")]
    strength: Annotated[Range, LogUniform("(0, 1000]")]
    range_m: Annotated[Range, LogUniform("(0, 1000]")]
    anticipation_s: Annotated[Range, Uniform("[0, 1000]")]
    border_strength: Annotated[Range, LogUniform("(0, 1000]")]
    border_range_m: Annotated[Range, LogUniform("(0, 1000]")]
    unseen_weight: Annotated[Range, Uniform("[0, 1]")]
    direction_push: Annotated[Range, Uniform("[0, 1000]")]
    direction_range_m: Annotated[Range, Uniform("(0, 1000]")]
    wall_push: Annotated[Range, Uniform("[0, 1000]")]
    wall_range_m: Annotated[Range, Uniform("(0, 1000]")]
    noise_mps2: Annotated[Range, Uniform("[0, 1000]")]
    wander_rad: Annotated[Range, LogUniform("(0, 1000]")]
    wander_s: Annotated[Range, Uniform("(0, 1000]")]
    unsteady: Annotated[Range, LogUniform("(0, 0.5]")]


class WalkingModel(NamedTuple):
    """Parameters of `walking.walk`, equal for all people of a world; the equations are there.

    Attributes:
        collision_free: whether the collision-free speed model is used instead of social forces.
        spacing_m: least distance to others when somebody appears.
        reach_m: distance at which a target counts as reached.
        leave: whether people leave at their last target.

    The others are drawn from the ranges of `ModelSettings`.
    """

    collision_free: bool
    strength: float
    range_m: float
    anticipation_s: float
    border_strength: float
    border_range_m: float
    unseen_weight: float
    direction_push: float
    direction_range_m: float
    wall_push: float
    wall_range_m: float
    noise_mps2: float
    wander_rad: float
    wander_s: float
    unsteady: float
    spacing_m: float
    reach_m: float
    leave: bool


_PUBLISHED = {
    "strength": 2.1,
    "range_m": 0.3,
    "anticipation_s": 0.5,
    "border_strength": 10.0,
    "border_range_m": 0.2,
}
"""Of Helbing & Molnar 1995."""


def draw_model(
    settings: ModelSettings,
    dense: bool,
    spacing_m: float,
    reach_m: float,
    leave: bool,
    rng: np.random.Generator,
) -> WalkingModel:
    """Draw the model of a world; the last three parameters of `WalkingModel` are given."""
    share = settings.dense_collision_free_share if dense else settings.collision_free_share
    collision_free, drawn = bool(rng.random() < share), draw_fields(settings, rng)
    if rng.random() < settings.published_share:
        drawn |= _PUBLISHED
    return WalkingModel(collision_free, **drawn, spacing_m=spacing_m, reach_m=reach_m, leave=leave)
