"""Simulated people who see the robot as one of them; they walk on, tick by tick, as it drives."""

from __future__ import annotations

import copy
import math

import numpy as np

from pedpred.compiled import compiled
from pedpred.scenes import BODY_M
from pedpred.simulation.worlds.journeys import Journeys, State
from pedpred.simulation.worlds.people import Traits
from pedpred.simulation.worlds.walking import (
    SPEED_CAP,
    FixedWorld,
    _accelerate,
    _decide,
    _let_in,
    _reach_target,
    _step,
)
from pedpred.simulation.worlds.world import STEP_S


@compiled
def _walk_on(
    step: int,
    until: int,
    entered: np.ndarray,
    since_s: np.ndarray,
    people: np.ndarray,
    inside: int,
    robots: int,
    hold: int,
    dt_s: float,
    world: FixedWorld,
    state: State,
    rng: np.random.Generator,
) -> int:  # pragma: no cover (compiled)
    """Let people come, walk and leave, as `simulation.worlds.walking.walk` does; return how many are inside.

    Args:
        step: number of the first step.
        until: number of the step after the last one.
        entered: who has come; changed in place. [N]
        since_s: when; changed in place. [N]
        people: numbers of those inside, first the robots; changed in place. [N]
        inside: how many these are.
        robots: how many of them are robots: others see them, and they go on at their velocity.
        hold: steps for which random accelerations are held.
        dt_s: length of a step, s.
        world: what does not change.
        state: of everybody; changed in place.
        rng: source of all randomness.
    """
    for now_step in range(step, until):
        now, before = now_step * dt_s, inside
        inside = _let_in(now, entered, people, inside, state, world, rng)
        for z in range(before, inside):
            since_s[people[z]] = now
        z = robots
        while z < inside:
            n = people[z]
            if _reach_target(n, now, state, world) and world.model.leave:
                inside -= 1
                people[z] = people[inside]
                continue
            _decide(n, now, dt_s, now_step % hold == 0, state, world, rng)
            z += 1
        for n in people[robots:inside]:
            _accelerate(n, now, dt_s, people[:inside], state, world)
        for n in people[:robots]:
            for k in range(2):
                state.position[n, k] += state.velocity[n, k] * dt_s
        for n in people[robots:inside]:
            _step(n, dt_s, state, SPEED_CAP * world.traits.desired_speed[n], world.ground)
    return inside


class Walkers:
    """The people of a simulated world, a `Crowd`; the last row of its journeys is the robot."""

    def __init__(self, world: FixedWorld, rng: np.random.Generator, dt_s: float):
        """Begin before anybody has come.

        Args:
            world: whose journeys and traits end with those of the robot, see `with_robot`.
            rng: source of all randomness.
            dt_s: time between two instants, s; a multiple of the simulation's step.
        """
        count = len(world.journeys.start_s)
        self._world, self._rng, self._every, self.dt_s = world, rng, round(dt_s / STEP_S), dt_s
        self._state, self._step = State.before(world.journeys), 0
        self._entered, self._since_s = np.zeros(count, bool), np.full(count, np.inf)
        self._people, self._inside, self._robots = np.zeros(count, np.int64), 0, 0
        self.track_id = np.arange(count - 1)

    def copied(self) -> Walkers:
        """The same people at the same instant, who go on by themselves."""
        other = copy.copy(self)
        other._state = State(*(values.copy() for values in self._state))
        other._rng, other._people = copy.deepcopy(self._rng), self._people.copy()
        other._entered, other._since_s = self._entered.copy(), self._since_s.copy()
        return other

    @property
    def position(self) -> np.ndarray:
        """Where people are, world frame, m; NaN: not there. [N, 2]."""
        there = np.full((len(self.track_id), 2), np.nan)
        who = self._people[self._robots : self._inside]
        there[who] = self._state.position[who]
        return there

    @property
    def there_s(self) -> np.ndarray:
        """For how long each person has been there, s. [N]."""
        return np.asarray(self._step * STEP_S - self._since_s[:-1])

    def meet(self, state: tuple[float, ...], velocity: np.ndarray) -> None:
        """Say where the robot is, and how fast it moves, m/s; from now on people see it."""
        if not self._robots:
            self._people[1 : self._inside + 1] = self._people[: self._inside].copy()
            self._people[0], self._robots, self._inside = len(self.track_id), 1, self._inside + 1
        own, speed = self._state, math.hypot(*velocity)
        own.position[-1], own.velocity[-1] = state[:2], velocity
        own.desired[-1] = velocity / speed if speed > 1e-6 else 0.0

    def advance(self, ticks: int = 1) -> None:
        """Walk on for some instants; a robot goes on at its velocity."""
        until = self._step + ticks * self._every
        self._inside = _walk_on(
            self._step, until, self._entered, self._since_s, self._people, self._inside, self._robots,
            self._every, STEP_S, self._world, self._state, self._rng,
        )  # fmt: skip
        self._step = until

    def ahead(self, ticks: int) -> np.ndarray:
        """Where people are now and will be, if the robot goes on at its velocity. [1 + ticks, N, 2]."""
        other, paths = self.copied(), [self.position]
        for _ in range(ticks):
            other.advance()
            paths.append(other.position)
        return np.array(paths)


def with_robot(journeys: Journeys, traits: Traits, radius_m: float) -> tuple[Journeys, Traits]:
    """Append a robot, which never comes by itself.

    Its body is so large that it touches the bodies of the simulation where the discs of the robot and of a
    person touch: people keep as far from it as its collisions demand.
    """
    rows = (np.concatenate([values, values[-1:]]) for values in journeys)
    journeys = Journeys(*rows)._replace(group=np.append(journeys.group, -1))
    journeys.start_s[-1] = np.inf
    traits = Traits(*(np.concatenate([values, values[-1:]]) for values in traits))
    traits.radius_m[-1] = radius_m + BODY_M - float(traits.radius_m[:-1].mean())
    return journeys, traits
