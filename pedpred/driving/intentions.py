"""Social forces towards the true goals: what a model of walking forecasts if it knows where people go."""

from __future__ import annotations

import functools
from functools import partial
from pathlib import Path

import numpy as np

from pedpred.driving.crowds import MovingCrowd
from pedpred.driving.tracked import TrackedPeople
from pedpred.errors import InputError
from pedpred.features import Pedestrians
from pedpred.files import read_yaml
from pedpred.online import OnlinePredictor
from pedpred.scenes import Forecast, OccupancyMap, Predictions
from pedpred.simulation.crowd import crowd_of
from pedpred.simulation.ground import ground_around
from pedpred.simulation.routing import Routes, routes_to
from pedpred.simulation.settings import SocialForceSettings, social_force_settings
from pedpred.simulation.simulator import rollout

FORCES = (
    Path(__file__).with_name("social_forces.yaml"),
    Path(__file__).parents[2] / "conf/social_forces/walking.yaml",
)
"""Parameters of social forces: in the installed package, and in the checkout."""
_PUBLISHED = "helbing1995"
_BEYOND_S = 10.0  # somebody without a goal goes on for so long


@functools.cache
def published_forces() -> SocialForceSettings:
    """Read the published parameters.

    Raises:
        InputError: the file is missing or damaged.
    """
    path = next((path for path in FORCES if path.is_file()), FORCES[-1])
    return social_force_settings(read_yaml(path, partial(InputError, path, "file"))[_PUBLISHED])


class SocialForces:
    """People walk to their true goals by social forces, without noise; they are tracked as for the others.

    It is given where people go, not how. The desired speed is the tracked one.
    """

    def __init__(self, predictor: OnlinePredictor, crowd: MovingCrowd, occupancy: OccupancyMap):
        """Begin without people.

        Args:
            predictor: whose tracker, steps and settings are used.
            crowd: who is asked for their goals.
            occupancy: the walls.
        """
        self._people, self._crowd, self._model = TrackedPeople(predictor), crowd, published_forces()
        self._protocol = predictor.protocol
        ends = np.concatenate([crowd.goals, occupancy.origin[None]])
        self._ground = ground_around(occupancy, ends, self._model.routing.resolution_m)
        self._routes: dict[int, Routes] = {}

    def update(self, time_s: float, track_id: np.ndarray, position: np.ndarray) -> Forecast:
        """See `Forecaster`."""
        here, dt_s = self._people.follow(time_s, track_id, position), self._protocol.dt_s
        path = np.zeros((0, self._protocol.horizon_steps, 2))
        if len(here.track_id):
            routes, plan = self._ways(here)
            people = crowd_of(here.position, here.velocity, np.hypot(*here.velocity.T), plan[:, None])
            path = rollout(people, self._ground, routes, self._model, path.shape[1], dt_s)
        pace = np.diff(np.concatenate([here.position[:, None], path], axis=1), axis=1) / dt_s
        return Forecast(time_s, here.track_id, pace, Predictions.single(path, dt_s))

    def _ways(self, people: Pedestrians) -> tuple[Routes, np.ndarray]:
        """Routes to the goals of some people, and which of them each takes; a robot goes straight on."""
        known = np.isin(people.track_id, self._crowd.track_id)
        goal = self._crowd.goal[np.searchsorted(self._crowd.track_id, people.track_id[known])]
        wanted, which = np.unique(goal, return_inverse=True)
        ways = [self._route(int(one)) for one in wanted]
        ahead = (people.position + _BEYOND_S * people.velocity)[~known]
        cells = ways[0].direction.shape[1:] if ways else (2, 2, 2)
        nowhere = np.zeros((len(ahead), *cells), np.float32)  # the kernel then walks straight
        target = np.concatenate([*(way.target for way in ways), ahead])
        direction = np.concatenate([*(way.direction for way in ways), nowhere])
        plan = np.empty(len(known), np.int64)
        plan[known], plan[~known] = which, len(wanted) + np.arange(len(ahead))
        return Routes(target, self._ground.origin, self._model.routing.resolution_m, direction), plan

    def _route(self, goal: int) -> Routes:
        """The way to one goal, computed when somebody is first seen who goes there."""
        if goal not in self._routes:
            self._routes[goal] = routes_to(self._crowd.goals[goal], self._ground, self._model.routing)
        return self._routes[goal]
