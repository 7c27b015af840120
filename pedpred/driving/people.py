"""People on the clock of a robot: what a drive asks of them, and recorded ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import Trajectories
from pedpred.tracking.tracks import LOST_AFTER_S, TIME_TOLERANCE_S, births


@dataclass(frozen=True)
class Window:
    """The people of some seconds, at regular instants.

    Attributes:
        dt_s: time between two instants, s.
        track_id: rising. [N]
        position: world frame, m; NaN where somebody is not there. [T, N, 2]
        there_s: for how long each person has been there, s; negative before. [T, N]
        goal: where the track of each person ends, world frame, m. [N, 2]
    """

    dt_s: float
    track_id: np.ndarray
    position: np.ndarray
    there_s: np.ndarray
    goal: np.ndarray


class RecordedPeople:
    """People who walk as they were recorded, whatever the robot does.

    Between two detections they follow a cubic that does not overshoot. An id that reappears after a gap of
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
        order = np.lexsort((trajectories.time_s, trajectories.track_id))
        time_s, position = trajectories.time_s[order], trajectories.position[order]
        first = np.flatnonzero(births(trajectories.track_id[order], time_s, position, LOST_AFTER_S))
        ends = np.append(first, len(time_s))[1:]
        start_s = float(time_s.min(initial=np.inf))
        self.dt_s, self.start_s = dt_s, start_s
        from scipy.interpolate import PchipInterpolator  # late: the command `pedpred` imports this module

        self._first_tick: list[int] = []
        self._paths: list[np.ndarray] = []
        for a, b in zip(first, ends, strict=True):
            begin = int(np.ceil((time_s[a] - start_s - TIME_TOLERANCE_S) / dt_s))
            end = int(np.floor((time_s[b - 1] - start_s + TIME_TOLERANCE_S) / dt_s))
            if b - a > 1 and end > begin:
                now = np.clip(start_s + np.arange(begin, end + 1) * dt_s, time_s[a], time_s[b - 1])
                self._first_tick.append(begin)
                self._paths.append(PchipInterpolator(time_s[a:b], position[a:b])(now))
        if not self._paths:
            raise ValueRuleError("track_id", len(time_s), "no pedestrian was detected twice")
        self._begin = np.array(self._first_tick)
        self._end = self._begin + [len(path) for path in self._paths]

    def __len__(self) -> int:
        return len(self._paths)

    @property
    def ticks(self) -> int:
        """Instants of the whole recording."""
        return int(self._end.max())

    def anywhere(self, rng: np.random.Generator) -> tuple[int, np.ndarray]:
        """Draw an instant and the place of somebody then: the tick, and world frame, m, [2]."""
        weight = self._end - self._begin
        who = int(rng.choice(len(self), p=weight / weight.sum()))
        tick = int(rng.integers(weight[who]))
        return int(self._begin[who]) + tick, self._paths[who][tick]

    def window(self, tick: int, count: int) -> Window:
        """The people of `count` instants from a tick on; those outside the recording are empty."""
        who = np.flatnonzero((self._begin < tick + count) & (self._end > tick))
        position = np.full((count, len(who), 2), np.nan)
        for column, n in enumerate(who):
            low, high = max(tick, self._begin[n]), min(tick + count, self._end[n])
            position[low - tick : high - tick, column] = self._paths[n][
                low - self._begin[n] : high - self._begin[n]
            ]
        there_s = (tick + np.arange(count)[:, None] - self._begin[who]) * self.dt_s
        goal = np.array([self._paths[n][-1] for n in who]).reshape(-1, 2)
        return Window(self.dt_s, who, position, there_s, goal)


class Crowd(Protocol):
    """The people of one drive, as its time goes on.

    Attributes:
        dt_s: time between two instants, s.
        track_id: rising. [N]
        position: where they are now, world frame, m; NaN: not there. [N, 2]
        there_s: for how long each person has been there, s. [N]
        goals: places where people go during the drive, world frame, m. [G, 2]
        goal: which of them each person goes to now. [N]
    """

    dt_s: float
    track_id: np.ndarray
    goals: np.ndarray

    @property
    def position(self) -> np.ndarray:
        """See above."""
        ...  # pragma: no cover

    @property
    def there_s(self) -> np.ndarray:
        """See above."""
        ...  # pragma: no cover

    @property
    def goal(self) -> np.ndarray:
        """See above."""
        ...  # pragma: no cover

    def meet(self, state: tuple[float, ...], velocity: np.ndarray) -> None:
        """Learn where the robot is, and its velocity, m/s."""
        ...  # pragma: no cover

    def advance(self) -> None:
        """Go on to the next instant."""
        ...  # pragma: no cover

    def ahead(self, ticks: int) -> np.ndarray:
        """Where they are now and will be, world frame, m. [1 + ticks, N, 2]."""
        ...  # pragma: no cover


class Replay:
    """The people of a window, a `Crowd`: they walk as they were recorded, whatever the robot does."""

    def __init__(self, window: Window):
        self.dt_s, self.track_id, self.goals = window.dt_s, window.track_id, window.goal
        self._window, self._now = window, 0

    @property
    def position(self) -> np.ndarray:
        """See `Crowd`."""
        return self._window.position[self._now]

    @property
    def there_s(self) -> np.ndarray:
        """See `Crowd`."""
        return self._window.there_s[self._now]

    @property
    def goal(self) -> np.ndarray:
        """See `Crowd`: where the track ends."""
        return np.arange(len(self.track_id))

    def meet(self, state: tuple[float, ...], velocity: np.ndarray) -> None:
        """Do not care where the robot is."""

    def advance(self) -> None:
        """See `Crowd`."""
        self._now += 1

    def ahead(self, ticks: int) -> np.ndarray:
        """See `Crowd`."""
        return self._window.position[self._now : self._now + 1 + ticks]
