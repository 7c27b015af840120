"""Simulated people who see the robot as one of them; they walk on, tick by tick, as it drives."""

from __future__ import annotations

import copy
import math

import numpy as np

from pedpred.scenes import BODY_M
from pedpred.simulation.crowd import Clock
from pedpred.simulation.worlds.journeys import Journeys, State
from pedpred.simulation.worlds.people import Traits
from pedpred.simulation.worlds.walking import FixedWorld, walk_on
from pedpred.simulation.worlds.world import STEP_S


class Walkers:
    """The people of a simulated world, a `Crowd`; the last row of its journeys is the robot."""

    def __init__(self, world: FixedWorld, rng: np.random.Generator, dt_s: float):
        """Begin before anybody has come.

        Args:
            world: whose journeys and traits end with those of the robot, see `with_robot`.
            rng: source of all randomness.
            dt_s: time between two instants, s; a multiple of the simulation's step.
        """
        every = round(dt_s / STEP_S)
        self._world, self._rng, self.dt_s = world, rng, dt_s
        self._clock = Clock(STEP_S, steps=every, every=every, hold=every)
        self._state, self._step, self._inside, self._robots = State.before(world.journeys), 0, 0, 0
        self.track_id, self.goals = np.arange(len(world.journeys.start_s) - 1), world.routes.target

    def copied(self) -> Walkers:
        """The same people at the same instant, who go on by themselves."""
        other = copy.copy(self)
        other._state = State(*(values.copy() for values in self._state))
        other._rng = copy.deepcopy(self._rng)
        return other

    @property
    def position(self) -> np.ndarray:
        """Where people are, world frame, m; NaN: not there. [N, 2]."""
        there = np.full((len(self.track_id), 2), np.nan)
        who = self._state.people[self._robots : self._inside]
        there[who] = self._state.position[who]
        return there

    @property
    def there_s(self) -> np.ndarray:
        """For how long each person has been there, s. [N]."""
        return np.asarray(self._step * STEP_S - self._state.since_s[:-1])

    @property
    def goal(self) -> np.ndarray:
        """Which of the goals each person walks to. [N]."""
        return np.asarray(self._world.journeys.plan[self.track_id, self._state.leg[:-1]])

    def meet(self, state: tuple[float, ...], velocity: np.ndarray) -> None:
        """Say where the robot is, and how fast it moves, m/s; from now on people see it."""
        crowd, speed = self._state, math.hypot(*velocity)
        if not self._robots:
            crowd.people[1 : self._inside + 1] = crowd.people[: self._inside].copy()
            crowd.people[0], self._robots, self._inside = len(self.track_id), 1, self._inside + 1
        crowd.position[-1], crowd.velocity[-1] = state[:2], velocity
        crowd.desired[-1] = velocity / speed if speed > 1e-6 else 0.0

    def advance(self, ticks: int = 1) -> None:
        """Walk on for some instants; a robot goes on at its velocity."""
        end = self._step + ticks * self._clock.steps
        self._inside = walk_on(
            self._step, end, self._inside, self._robots, self._world, self._state, self._clock, self._rng
        )
        self._step = end

    def ahead(self, ticks: int) -> np.ndarray:
        """Where people are now and will be, if the robot goes on at its velocity. [1 + ticks, N, 2]."""
        other, paths = self.copied(), [self.position]
        for _ in range(ticks):
            other.advance()
            paths.append(other.position)
        return np.array(paths)


def with_robot(world: FixedWorld, radius_m: float) -> FixedWorld:
    """Append a robot, which never comes by itself, to the people of a world.

    Its body is so large that it touches the bodies of the simulation where the discs of the robot and of a
    person touch: people keep as far from it as its collisions demand.
    """
    both = (world.journeys, world.traits)
    rows = [[np.concatenate([values, values[-1:]]) for values in columns] for columns in both]
    journeys, traits = Journeys(*rows[0]), Traits(*rows[1])
    journeys.start_s[-1], journeys.group[-1] = np.inf, -1
    traits.radius_m[-1] = radius_m + BODY_M - float(traits.radius_m[:-1].mean())
    return world._replace(journeys=journeys, traits=traits)
