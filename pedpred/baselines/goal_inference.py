"""Social forces without oracle knowledge: goals and desired speeds are inferred from the motion so far.

The model is the simulator's own, but the goal of each pedestrian is a belief over candidates (`beliefs.py`).
Several joint draws from all beliefs are rolled out, and each pedestrian is forecast where the mean distance
to its drawn futures is least. The choice of candidates (`candidates.py`) makes two bounds:

* the room's own pool of targets (`goal_blind`): close to the best forecast that knows where people of this
  room go, but not who goes where;
* places drawn as the simulator draws targets (`goal_unseen`): close to the best forecast that knows how
  people walk and the map, but has not seen the room before. A learned forecaster knows no more. Neither
  bound uses what could be learnt from watching others arrive, who share the room's targets.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator

import numpy as np

from pedpred.baselines.beliefs import beliefs
from pedpred.baselines.candidates import Candidates, draw_candidates, room_goals
from pedpred.baselines.influences import Observations
from pedpred.baselines.together import Present, forecast_jointly, roll_out_all
from pedpred.baselines.walking import Walking
from pedpred.errors import ValueRuleError
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.geometry import rotate
from pedpred.scenes import Predictions
from pedpred.simulation.crowd import crowd_of
from pedpred.simulation.ground import ground_of
from pedpred.simulation.routing import routes_to
from pedpred.simulation.simulator import successors
from pedpred.tracking.tracks import last_rows

DRAWS = 8  # twice as many lower the error by 1 to 3 % (two rooms of `main`) and take nearly twice the time
_AS_NEAR_AS_M = 1e-3
_MOST_GOALS = 100_000


def goal_blind() -> Forecaster:
    """Make the forecaster that knows the room's targets; it has no settings."""

    def forecast(request: ForecastRequest) -> Predictions:
        return _infer(request, room_goals(request.scene), _generator(request))

    return forecast


def goal_unseen(imagined_goals: int) -> Forecaster:
    """Make the forecaster that draws possible targets itself.

    Args:
        imagined_goals: how many to draw per room.

    Raises:
        ValueRuleError: their number is none.
    """
    if type(imagined_goals) is not int or not 1 <= imagined_goals <= _MOST_GOALS:
        rule = f"it must be a whole number in [1, {_MOST_GOALS}]"
        raise ValueRuleError("imagined_goals", imagined_goals, rule)

    def forecast(request: ForecastRequest) -> Predictions:
        rng, clearance_m = _generator(request), request.walking_model.crowd.clearance_m
        return _infer(
            request, draw_candidates(request.scene.occupancy, clearance_m, imagined_goals, rng), rng
        )

    return forecast


def _infer(request: ForecastRequest, candidates: Candidates, rng: np.random.Generator) -> Predictions:
    return forecast_jointly(request, lambda people: infer_paths(request, people, candidates, rng))


def _generator(request: ForecastRequest) -> np.random.Generator:
    return np.random.default_rng(zlib.crc32(request.scene.name.encode()))


def infer_paths(
    request: ForecastRequest,
    people: Present,
    candidates: Candidates,
    rng: np.random.Generator,
    draws: int = DRAWS,
) -> np.ndarray:
    """Forecast pedestrians of whom only the past is known.

    Args:
        request: what is asked; beliefs are formed along its clock, whose steps are of one length.
        people: whom to forecast: all people at some instants. [R]
        candidates: possible goals.
        rng: combines the draws of different pedestrians.
        draws: joint futures per instant, D.

    Returns:
        World positions, m. [R, P, 2]
    """
    sizes, steps, model = request.sizes, request.steps, request.walking_model
    ground = ground_of(request.scene.occupancy)
    routes = routes_to(candidates.position, ground, model.routing)
    allowed = successors(routes.target, np.arange(len(routes.target)), model.crowd.least_leg_m)
    following = allowed / allowed.sum(axis=1, keepdims=True)
    walking = Walking(sizes.dt_s, model, following, candidates.spread_m)
    seen = Observations(steps.position, rotate(steps.velocity, steps.heading_rad).astype(np.float64))
    latest = last_rows(steps.track_id, steps.time_s, people.track_id, people.time_s)
    belief = beliefs(seen, steps.step, steps.time_s, ground, routes, walking).at(latest)
    futures = np.empty((draws, len(latest), sizes.horizon_steps, 2))
    for draw, plan in enumerate(draw_plans(belief.probability, following, draws, rng)):
        speed = np.take_along_axis(belief.speed_mps, plan[:, :1], axis=1)[:, 0]
        speed = np.clip(speed, *model.crowd.speed_range_mps)
        crowd = crowd_of(people.position, people.velocity, speed, plan)
        steps_s = sizes.horizon_steps, sizes.dt_s
        futures[draw] = roll_out_all(crowd, people.time_s, ground, routes, model, *steps_s)
    return geometric_median(futures)


def draw_plans(
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
