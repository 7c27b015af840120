"""Robots: their limits, how they move, and the short manoeuvres that a planner chooses among."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from pedpred.compiled import compiled
from pedpred.errors import ValueRuleError
from pedpred.settings import In, Settings

KINDS = ("differential", "holonomic")
_TURNS = (0.0, 0.15, 0.35, 0.65, 1.0)  # shares of the largest turn rate, to either side
_SPEEDS = (0.25, 0.5, 0.75, 1.0)  # shares of the largest speed
_DIRECTIONS = 16


class Limits(NamedTuple):
    """What compiled loops need of a robot; see `Robot`."""

    holonomic: bool
    speed_mps: float
    turn_radps: float
    acceleration_mps2: float
    braking_mps2: float
    turn_acceleration_radps2: float


@dataclass(frozen=True)
class Robot(Settings):
    """A round robot. A state is (x, y, heading, a, b): world frame, m and rad.

    With differential drive, (a, b) are speed, m/s, and turn rate, rad/s, and it does not drive backwards.
    A holonomic robot has the velocity (a, b) in the world frame, m/s, and its heading does not matter.

    Attributes:
        kind: one of `KINDS`.
        radius_m: of its footprint.
        speed_mps: largest speed.
        turn_radps: largest turn rate.
        acceleration_mps2: largest acceleration.
        braking_mps2: largest deceleration.
        turn_acceleration_radps2: largest change of the turn rate.
    """

    kind: str = "differential"
    radius_m: Annotated[float, In("[0.05, 10]")] = 0.3
    speed_mps: Annotated[float, In("[0.05, 10]")] = 1.2
    turn_radps: Annotated[float, In("[0.05, 10]")] = 1.5
    acceleration_mps2: Annotated[float, In("[0.05, 10]")] = 1.0
    braking_mps2: Annotated[float, In("[0.05, 10]")] = 2.0
    turn_acceleration_radps2: Annotated[float, In("[0.05, 10]")] = 3.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.kind not in KINDS:
            raise ValueRuleError("kind", self.kind, f"it must be one of {', '.join(KINDS)}")

    @property
    def limits(self) -> Limits:
        """The limits, for compiled loops."""
        return Limits(
            self.kind == "holonomic", self.speed_mps, self.turn_radps, self.acceleration_mps2,
            self.braking_mps2, self.turn_acceleration_radps2,
        )  # fmt: skip

    def braking_s(self) -> float:
        """Time from full speed to standstill, s."""
        return self.speed_mps / self.braking_mps2

    def manoeuvres(self, ahead_rad: float, steps: int, first: int, hold: int) -> np.ndarray:
        """Commanded (a, b) at each step of the manoeuvres; each ends with braking. [C, S, 2].

        A manoeuvre holds one command for `first` steps, and the same or another one until `hold` steps. The
        first manoeuvre is to brake at once. The set is the same for a robot in a mirrored world.

        Args:
            ahead_rad: direction of the route, world frame; for a holonomic robot.
            steps: S, so many that the robot stands at the end.
            first: steps of the first command.
            hold: steps after which it brakes.
        """
        if self.kind == "differential":
            return _turning(self.speed_mps, self.turn_radps, steps, first, hold)
        return _rolled_out(self._directed(ahead_rad), steps, first, hold)

    def _directed(self, ahead_rad: float) -> np.ndarray:
        """Pairs of velocities. [C, 2, 2]."""
        angle = ahead_rad + np.arange(_DIRECTIONS) * 2 * np.pi / _DIRECTIONS
        units = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        once = (np.array(_SPEEDS)[:, None, None] * units).reshape(-1, 2)
        then = np.broadcast_to(units[0], once.shape)
        same, on = np.stack([once, once], axis=1), np.stack([once, then], axis=1)
        return np.concatenate([same, on]) * self.speed_mps


@functools.lru_cache(maxsize=8)
def _turning(speed_mps: float, turn_radps: float, steps: int, first: int, hold: int) -> np.ndarray:
    """Manoeuvres with differential drive. [C, S, 2]."""
    turns = [share * side for share in _TURNS for side in (-1.0, 1.0)][1:]
    pairs = [[(v, w), (v, side * w)] for v in _SPEEDS for w in turns for side in (1.0, 0.0, -1.0)]
    pairs += [[(0.0, w), (0.5, 0.0)] for w in turns]
    return _rolled_out(np.array(pairs) * (speed_mps, turn_radps), steps, first, hold)


def _rolled_out(pairs: np.ndarray, steps: int, first: int, hold: int) -> np.ndarray:
    """Commands at each step, each manoeuvre once, from pairs [C, 2, 2]. [C, S, 2]."""
    commands = np.zeros((2 * len(pairs) + 1, steps, 2))
    commands[1::2, :first] = commands[2::2, :first] = pairs[:, :1]
    commands[2::2, first:hold] = pairs[:, 1:]
    _, kept = np.unique(commands, axis=0, return_index=True)
    return np.asarray(commands[np.sort(kept)])


@compiled
def advance(state, a, b, limits, dt_s):  # pragma: no cover (compiled)
    """State after a step with the command (a, b), within the limits; a tuple like `state`."""
    x, y, heading, now_a, now_b = state
    if limits.holonomic:
        to_a, to_b = a - now_a, b - now_b
        faster = math.hypot(a, b) > math.hypot(now_a, now_b) + 1e-6  # not because of rounding
        rate = limits.acceleration_mps2 if faster else limits.braking_mps2
        share = min(1.0, rate * dt_s / max(math.hypot(to_a, to_b), 1e-12))
        new_a, new_b = now_a + share * to_a, now_b + share * to_b
        x += 0.5 * (now_a + new_a) * dt_s
        y += 0.5 * (now_b + new_b) * dt_s
        return x, y, heading, new_a, new_b
    new_a = now_a + min(max(a - now_a, -limits.braking_mps2 * dt_s), limits.acceleration_mps2 * dt_s)
    most = limits.turn_acceleration_radps2 * dt_s
    new_b = now_b + min(max(b - now_b, -most), most)
    speed, turn = 0.5 * (now_a + new_a), 0.5 * (now_b + new_b)
    middle = heading + 0.5 * turn * dt_s
    x += speed * math.cos(middle) * dt_s
    y += speed * math.sin(middle) * dt_s
    return x, y, heading + turn * dt_s, new_a, new_b
