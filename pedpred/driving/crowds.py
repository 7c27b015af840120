"""The people of a drive on the clock of its robot: recorded ones, and simulated ones who react to it."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, replace

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import BODY_M, Trajectories
from pedpred.simulation.crowd import Clock
from pedpred.simulation.worlds.journeys import Journeys, State
from pedpred.simulation.worlds.people import Traits
from pedpred.simulation.worlds.walking import FixedWorld, walk_on
from pedpred.simulation.worlds.world import STEP_S
from pedpred.tracking.tracks import LOST_AFTER_S, TIME_TOLERANCE_S, births


@dataclass
class ReplayedCrowd:
    """The people of some seconds, who walk as they were recorded, whatever the robot does.

    Attributes:
        dt_s: time between two instants, s.
        track_id: rising. [N]
        path: world frame, m; NaN where somebody is not there. [T, N, 2]
        path_there_s: for how long each person has been there, s; negative before. [T, N]
        goals: where the track of each person ends, world frame, m. [N, 2]
        tick: the present instant.
    """

    dt_s: float
    track_id: np.ndarray
    path: np.ndarray
    path_there_s: np.ndarray
    goals: np.ndarray
    tick: int = 0

    def copied(self) -> ReplayedCrowd:
        """The same people at the same instant, who go on by themselves."""
        return replace(self)

    @property
    def position(self) -> np.ndarray:
        """Where people are, world frame, m; NaN: not there. [N, 2]."""
        return self.path[self.tick]

    @property
    def there_s(self) -> np.ndarray:
        """For how long each person has been there, s. [N]."""
        return self.path_there_s[self.tick]

    @property
    def goal(self) -> np.ndarray:
        """Which of the goals each person walks to. [N]."""
        return np.arange(len(self.track_id))

    def meet(self, state: tuple[float, ...], velocity: np.ndarray) -> None:
        """Ignore the robot."""

    def advance(self) -> None:
        """Go on to the next instant."""
        self.tick += 1

    def ahead(self, ticks: int) -> np.ndarray:
        """Where people are now and will be, world frame, m. [1 + ticks, N, 2]."""
        return self.path[self.tick : self.tick + 1 + ticks]


class RecordedPeople:
    """A whole recording at the instants of a robot's clock.

    Between two detections people follow a cubic that does not overshoot. An id that reappears after a gap of
    more than 2 s is another person.
    """

    def __init__(self, trajectories: Trajectories, dt_s: float):
        """Interpolate a recording.

        Args:
            trajectories: of the people.
            dt_s: time between two instants of the robot's clock, s.

        Raises:
            ValueRuleError: nobody was detected twice.
        """
        from scipy.interpolate import PchipInterpolator  # late: the command `pedpred` imports this module

        order = np.lexsort((trajectories.time_s, trajectories.track_id))
        time_s, position = trajectories.time_s[order], trajectories.position[order]
        first = np.flatnonzero(births(trajectories.track_id[order], time_s, position, LOST_AFTER_S))
        self.dt_s, self.start_s = dt_s, float(time_s.min(initial=np.inf))
        begins: list[int] = []
        self._paths: list[np.ndarray] = []
        for a, b in zip(first, np.append(first, len(time_s))[1:], strict=True):
            begin = int(np.ceil((time_s[a] - self.start_s - TIME_TOLERANCE_S) / dt_s))
            end = int(np.floor((time_s[b - 1] - self.start_s + TIME_TOLERANCE_S) / dt_s))
            if b - a > 1 and end > begin:
                now = self.start_s + np.arange(begin, end + 1) * dt_s
                path = PchipInterpolator(time_s[a:b], position[a:b])
                begins.append(begin)
                self._paths.append(path(np.clip(now, time_s[a], time_s[b - 1])))
        if not self._paths:
            raise ValueRuleError("track_id", len(time_s), "no pedestrian was detected twice")
        self._begin = np.array(begins)
        self._end = self._begin + [len(path) for path in self._paths]

    def draw_place(self, rng: np.random.Generator) -> tuple[int, np.ndarray]:
        """Draw an instant and the place of somebody then: the tick, and world frame, m, [2]."""
        weight = self._end - self._begin
        who = int(rng.choice(len(weight), p=weight / weight.sum()))
        tick = int(rng.integers(weight[who]))
        return int(self._begin[who]) + tick, self._paths[who][tick]

    def window(self, tick: int, count: int) -> ReplayedCrowd:
        """The people of `count` instants from a tick on; those outside the recording are empty."""
        who = np.flatnonzero((self._begin < tick + count) & (self._end > tick))
        path = np.full((count, len(who), 2), np.nan)
        for column, n in enumerate(who):
            low, high = max(tick, self._begin[n]), min(tick + count, self._end[n])
            path[low - tick : high - tick, column] = self._paths[n][
                low - self._begin[n] : high - self._begin[n]
            ]
        there_s = (tick + np.arange(count)[:, None] - self._begin[who]) * self.dt_s
        goals = np.array([self._paths[n][-1] for n in who]).reshape(-1, 2)
        return ReplayedCrowd(self.dt_s, who, path, there_s, goals)


class ReactiveCrowd:
    """The people of a simulated world, who see the robot as one of them and walk on as it drives.

    The last row of the world's journeys and traits is the robot, see `with_robot`. `dt_s`, `track_id` [N] and
    `goals` [G, 2] are those of `ReplayedCrowd`.
    """

    def __init__(self, world: FixedWorld, rng: np.random.Generator, dt_s: float):
        """Begin before anybody has come.

        Args:
            world: whose journeys and traits end with those of the robot.
            rng: source of all randomness.
            dt_s: time between two instants, s; a multiple of the simulation's step.
        """
        every = round(dt_s / STEP_S)
        self._world, self._rng, self.dt_s = world, rng, dt_s
        self._clock = Clock(STEP_S, steps=every, every=every, hold=every)
        self._state, self._step, self._inside, self._robots = State.before(world.journeys), 0, 0, 0
        self.track_id, self.goals = np.arange(len(world.journeys.start_s) - 1), world.routes.target

    def copied(self) -> ReactiveCrowd:
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


MovingCrowd = ReplayedCrowd | ReactiveCrowd
"""The people of one drive, as its time goes on."""


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
