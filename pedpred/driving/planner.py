"""A local planner: short manoeuvres, each ending in standstill, under a limit of the risk while moving.

Every manoeuvre is rolled out through the robot's limits (as in the dynamic window approach, Fox et al. 1997).
Its risk is the largest probability, over the steps in which it moves, to overlap somebody whom it drives
towards (`pedpred.driving.risk`). Among those whose risk is within the limit and that touch no wall it takes

    min  t_goal + w_p sum_s P_s dt + w_c sum_s max(0, c - distance_s) dt + w_s (|dv| / v_max + |dw| / w_max)

with the time to the goal t_goal (S dt plus the way left at full speed, if it is not reached within S steps),
the probability P_s to overlap anybody at step s, moving or not, and the change of the command. If there is
none, it brakes. The manoeuvre under way is always one of the candidates. As all end in standstill, a robot
that knows the future never drives into anybody (passive safety, Macek et al. 2009): it can go on as planned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from pedpred.compiled import compiled
from pedpred.driving.course import Course, ahead_at
from pedpred.driving.risk import Expected, Steps, contact_m, expected, risk_at, within_reach
from pedpred.driving.robot import Robot, advance
from pedpred.errors import ValueRuleError
from pedpred.scenes import Forecast
from pedpred.settings import In, Settings
from pedpred.simulation.physics import value_at


@dataclass(frozen=True)
class PlannerSettings(Settings):
    """Weights and distances of the planner.

    Attributes:
        risk: limit of the probability to overlap somebody at a step.
        dt_s: time between two steps, and between two plans, s.
        horizon_s: of a manoeuvre, s.
        first_s: length of its first command, s.
        margin_m: added to the distance at which discs touch.
        wall_m: least distance between the robot's edge and walls.
        comfortable_m: distance between the robot's edge and walls from which on it has no cost.
        near_m: the goal is reached within this distance.
        exposure_weight: w_p, s of detour per s of overlap.
        wall_weight: w_c, s of detour per s and m.
        change_weight: w_s, s.
    """

    risk: Annotated[float, In("[0, 1)")] = 0.1
    dt_s: Annotated[float, In("[0.05, 0.5]")] = 0.1
    horizon_s: Annotated[float, In("[1, 10]")] = 3.0
    first_s: Annotated[float, In("[0, 100]")] = 0.7
    margin_m: Annotated[float, In("[0, 100]")] = 0.05
    wall_m: Annotated[float, In("[0, 100]")] = 0.05
    comfortable_m: Annotated[float, In("[0, 100]")] = 0.3
    near_m: Annotated[float, In("[0, 100]")] = 0.3
    exposure_weight: Annotated[float, In("[0, 100]")] = 5.0
    wall_weight: Annotated[float, In("[0, 100]")] = 1.0
    change_weight: Annotated[float, In("[0, 100]")] = 0.05


def check_braking(robot: Robot, planner: PlannerSettings) -> None:
    """Check that a manoeuvre can have a step at full speed and end in standstill.

    Raises:
        ValueRuleError: the robot is too fast for that.
    """
    if _hold(robot, planner) < 1:
        most_mps = robot.braking_mps2 * planner.dt_s * (_count(planner) - 2)
        rule = f"manoeuvres of {planner.horizon_s:g} s end in standstill: it must be at most {most_mps:g}"
        raise ValueRuleError("speed_mps", robot.speed_mps, rule)


def _count(planner: PlannerSettings) -> int:
    """Steps of a manoeuvre."""
    return round(planner.horizon_s / planner.dt_s)


def _hold(robot: Robot, planner: PlannerSettings) -> int:
    """Steps of a manoeuvre after which it brakes; so many are left as it needs from full speed, and one."""
    return _count(planner) - math.ceil(robot.braking_s() / planner.dt_s - 1e-9) - 1


class _Weights(NamedTuple):
    dt_s: float
    touch_m: float
    wall_m: float
    comfortable_m: float
    near_m: float
    exposure: float
    wall: float
    change: float


@compiled
def _equal_steps(one, other):  # pragma: no cover (compiled)
    """Number of first steps at which two manoeuvres have the same command."""
    for s in range(len(one)):
        if one[s, 0] != other[s, 0] or one[s, 1] != other[s, 1]:
            return s
    return len(one)


@compiled
def _assess(commands, start, limits, course, people, weights, limit):  # pragma: no cover (compiled)
    """Cost of each manoeuvre; infinite where it touches a wall or its risk is above the limit. [C].

    The steps that a manoeuvre has in common with the one before are not computed again.

    Args:
        commands: of `Robot.manoeuvres`. [C, S, 2]
        start: the robot's state.
        limits: of the robot.
        course: to the goal.
        people: where they are expected.
        weights: of the cost, with dt and distances from the robot's middle.
        limit: of the risk.
    """
    count, steps = commands.shape[:2]
    cost = np.full(count, np.inf)
    touch_m = weights.touch_m
    near = within_reach(people, start[0], start[1], limits.speed_mps, weights.dt_s, touch_m)
    states, sums, done = np.empty((steps + 1, 5)), np.zeros((steps + 1, 4)), 0
    states[0] = start
    sums[0] = 0.0, 0.0, -1.0, value_at(course.distance, course.origin, course.cell_m, start[0], start[1])
    for c in range(count):
        same = _equal_steps(commands[c - 1], commands[c]) if c > 0 else 0
        if same > done:  # it fails where the one before did
            continue
        state = states[same, 0], states[same, 1], states[same, 2], states[same, 3], states[same, 4]
        exposure, narrow, reached_s, wall = sums[same]
        for s in range(same, steps):
            done = s
            x, y = state[0], state[1]
            state = advance(state, commands[c, s, 0], commands[c, s, 1], limits, weights.dt_s)
            to_x, to_y, before = state[0] - x, state[1] - y, wall
            wall = value_at(course.distance, course.origin, course.cell_m, state[0], state[1])
            if wall < weights.wall_m and wall < before - 1e-9:
                break
            narrow += max(0.0, weights.comfortable_m - wall)
            if reached_s < 0.0:
                if math.hypot(course.goal[0] - state[0], course.goal[1] - state[1]) < weights.near_m:
                    reached_s = (s + 1) * weights.dt_s
                anybody, ahead = risk_at(s, state[0], state[1], to_x, to_y, people, near, touch_m)
                if ahead > limit:
                    break
                exposure += anybody
            states[s + 1] = state
            sums[s + 1] = exposure, narrow, reached_s, wall
        else:
            done = steps
            if reached_s < 0.0:
                left_m = value_at(course.to_go, course.origin, course.cell_m, state[0], state[1])
                reached_s = steps * weights.dt_s + left_m / limits.speed_mps
            widest = limits.speed_mps if limits.holonomic else limits.turn_radps
            change = abs(commands[c, 0, 0] - start[3]) / limits.speed_mps
            change += abs(commands[c, 0, 1] - start[4]) / widest
            spent = weights.exposure * exposure + weights.wall * narrow
            cost[c] = reached_s + weights.dt_s * spent + weights.change * change
    return cost


class Planner:
    """Plans for one robot on one course; it remembers the manoeuvre under way."""

    def __init__(self, robot: Robot, course: Course, settings: PlannerSettings):
        self._robot, self._course, self._settings = robot, course, settings
        count = _count(settings)
        self._steps = Steps(settings.dt_s, count)
        self._hold = _hold(robot, settings)
        self._first = min(round(settings.first_s / settings.dt_s), self._hold)
        radius_m = robot.radius_m
        self._weights = _Weights(
            settings.dt_s, contact_m(radius_m) + settings.margin_m, radius_m + settings.wall_m,
            radius_m + settings.comfortable_m, settings.near_m, settings.exposure_weight,
            settings.wall_weight, settings.change_weight,
        )  # fmt: skip
        self._under_way = np.zeros((count, 2))

    def command(self, state: tuple[float, ...], forecast: Forecast, noise_m: float) -> np.ndarray:
        """Choose what to do for the next `dt_s`.

        Args:
            state: of the robot, see `Robot`.
            forecast: of the people, world frame; rows with NaN are nobody.
            noise_m: standard deviation of where people are now, m.

        Returns:
            Command (a, b), as in `Robot`. [2]
        """
        ahead = ahead_at(self._course, state[0], state[1])
        offered = self._robot.manoeuvres(ahead, self._steps.count, self._first, self._hold)
        going_on = np.append(self._under_way[1:], np.zeros((1, 2)), axis=0)
        offered = np.concatenate([offered, going_on[None]])
        people = expected(forecast, self._steps, noise_m)
        cost = self.costs(offered, state, people, self._settings.risk)
        self._under_way = offered[np.argmin(cost)]  # the first one, to brake, if none is allowed
        return self._under_way[0]

    def costs(
        self, commands: np.ndarray, state: tuple[float, ...], people: Expected, limit: float
    ) -> np.ndarray:
        """Assess manoeuvres; infinite: it touches a wall, or its risk is above the limit. [C].

        Args:
            commands: of `Robot.manoeuvres`. [C, S, 2]
            state: of the robot.
            people: where they are expected.
            limit: of the risk.
        """
        limits = self._robot.limits
        return np.asarray(_assess(commands, state, limits, self._course, people, self._weights, limit))
