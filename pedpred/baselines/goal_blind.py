"""Social forces without oracle knowledge: goals and desired speeds are inferred from the motion so far.

The model is the simulator's own, but who is heading for which of some candidates is a belief (`beliefs.py`).
Several joint draws from everybody's belief are rolled out, and each pedestrian is forecast where the mean
distance to its drawn futures is least. What the candidates are (`candidates.py`) makes two yardsticks:

* the room's own pool of targets (`goal_blind`): close to the best of whoever knows where people of this
  room go, but not who goes where;
* places drawn anew as the simulator draws targets (`goal_unseen`): close to the best of whoever knows how
  people walk and the map, and sees this room for the first time. A learned forecaster knows no more. What
  it could learn from watching others arrive, for they share the room's targets, is left out in both.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from pedpred.baselines.beliefs import beliefs, walking
from pedpred.baselines.candidates import Candidates
from pedpred.baselines.influences import Observations
from pedpred.baselines.together import rolled_out
from pedpred.features import FeatureTable
from pedpred.geometry import rotate
from pedpred.scenes import OccupancyMap
from pedpred.simulation.crowd import crowd_of
from pedpred.simulation.ground import ground_of
from pedpred.simulation.routing import routes_to
from pedpred.simulation.settings import social_force_settings
from pedpred.simulation.simulator import successors

DRAWS = 8  # twice as many lower the error by 1 to 3 % (two rooms of `main`) and take nearly twice the time
_AS_NEAR_AS_M = 1e-3


def goal_blind_paths(
    occupancy: OccupancyMap,
    table: FeatureTable,
    rows: np.ndarray,
    candidates: Candidates,
    settings: Mapping[str, Any],
    horizon_steps: int,
    dt_s: float,
    rng: np.random.Generator,
    draws: int = DRAWS,
) -> np.ndarray:
    """Future paths of pedestrians of whom only the past is known.

    Args:
        occupancy: obstacles.
        table: the tracked past of everybody, sorted by track and step.
        rows: what to forecast: everybody at some instants. [R]
        candidates: where anybody may be heading.
        settings: configuration group `social_force`.
        horizon_steps: P.
        dt_s: time between two steps of the table and of the horizon, s.
        rng: decides whose draws meet whose.
        draws: joint futures per instant, D.

    Returns:
        World positions, m. [R, P, 2]
    """
    model = social_force_settings(settings)
    ground = ground_of(occupancy)
    routes = routes_to(candidates.position, ground, model.routing)
    allowed = successors(routes.target, np.arange(len(routes.target)), model.crowd.least_leg_m)
    moving = walking(dt_s, model, allowed, candidates.spread_m)
    seen = Observations(table.position, rotate(table.velocity, table.heading_rad).astype(np.float64))
    belief = beliefs(seen, table.step, table.time_s, ground, routes, moving).at(rows)
    here, time_s = seen.at(rows), table.time_s[rows]
    futures = np.empty((draws, len(rows), horizon_steps, 2))
    for draw, plan in enumerate(drawn_plans(belief.probability, moving.following, draws, rng)):
        speed = np.take_along_axis(belief.speed_mps, plan[:, :1], axis=1)[:, 0]
        speed = np.clip(speed, *model.crowd.speed_range_mps)
        crowd = crowd_of(here.position, here.velocity, speed, plan)
        futures[draw] = rolled_out(crowd, time_s, ground, routes, model, horizon_steps, dt_s)
    return geometric_median(futures)


def drawn_plans(
    probability: np.ndarray, following: np.ndarray, draws: int, rng: np.random.Generator
) -> Iterator[np.ndarray]:
    """Plans of two goals, in equally likely draws that together follow the belief (systematic sampling).

    Draw k takes the plan at the quantile (k + 1/2) / D of a pedestrian's distribution; each pedestrian's
    draws come in an order of its own, so that the plans of several meet in all combinations.

    Args:
        probability: of the goals. [N, G]
        following: probability of each goal to follow another. [G, G]
        draws: D.
        rng: of the orders.

    Yields:
        Indices of the goal and the next one; D times. [N, 2]
    """
    everyone, last = np.arange(len(probability)), probability.shape[1] - 1
    upto, next_upto = probability.cumsum(axis=1), following.cumsum(axis=1)
    quantile = (rng.permuted(np.tile(np.arange(draws), (len(probability), 1)), axis=1) + 0.5) / draws
    for level in quantile.T:
        goal = np.minimum((upto < level[:, None]).sum(axis=1), last)
        within = 1.0 - (upto[everyone, goal] - level) / probability[everyone, goal]
        follower = np.minimum((next_upto[goal] < within[:, None]).sum(axis=1), last)
        yield np.stack([goal, follower], axis=1)


def geometric_median(points: np.ndarray, rounds: int = 10) -> np.ndarray:
    """Point of least mean distance to equally likely ones, by Weiszfeld's reweighting from the mean on.

    It minimises the expected displacement error, as the mean minimises its square.

    Args:
        points: m. [D, ..., 2]
        rounds: of reweighting.

    Returns:
        m. [..., 2]
    """
    center = points.mean(axis=0)
    for _ in range(rounds):
        weight = 1.0 / np.maximum(np.linalg.norm(points - center, axis=-1, keepdims=True), _AS_NEAR_AS_M)
        center = (points * weight).sum(axis=0) / weight.sum(axis=0)
    return center
