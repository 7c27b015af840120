"""What manoeuvres cost, and which one is chosen: numbers by hand."""

import math

import numpy as np
import pytest

from pedpred.driving.course import Course
from pedpred.driving.planner import Planner, PlannerSettings, check_braking
from pedpred.driving.risk import Steps, expected
from pedpred.driving.robot import Robot
from pedpred.errors import ValueRuleError
from pedpred.scenes import Forecast, Predictions
from tests.by_hand.robots import HOLONOMIC, LIMITS, ROBOT

FREE = {"exposure_weight": 0.0, "wall_weight": 0.0, "change_weight": 0.0}
"""Only time has a cost."""
PLACE, TURN = np.array([0.7, -0.4]), np.array([[0.6, -0.8], [0.8, 0.6]])
"""Places are given in a frame with this origin and turn, so that both axes of the world matter."""
AHEAD, STILL = (0.0, 0.0, 0.0, 1.0, 0.0), (0.0,) * 5
"""A robot at the origin that drives at 1 m/s along x, and one that stands."""
STEPS = 12


def settings(dt_s=0.1, **weights):
    usual = {"risk": 0.25, "horizon_s": 1.2, "first_s": 0.2, "margin_m": 0.05, "wall_m": 0.05}
    return PlannerSettings(dt_s=dt_s, comfortable_m=0.3, near_m=0.3, **(usual | FREE | weights))


def there(x, y):
    return PLACE + TURN @ [x, y]


def placed(state):
    x, y, heading, *velocity = state
    return (*there(x, y).tolist(), heading + math.atan2(0.8, 0.6), *velocity)


def course(goal=(90.0, 0.0), wall=(50.0, 0.0, 0.0), to_go=(0.0, 0.0, 0.0)):
    """Distances c + c_x x + c_y y, which interpolation between the centres of cells leaves as they are."""
    cells = np.stack(np.indices((20, 16)), axis=-1)
    x, y = np.moveaxis((np.array([-4.0, -3.0]) + 0.5 * (cells + 0.5) - PLACE) @ TURN, -1, 0)
    fields = [c + c_x * x + c_y * y for c, c_x, c_y in (wall, to_go)]
    return Course(np.array([-4.0, -3.0]), 0.5, *fields, there(*goal))


def forecast_of(*people):
    """People (x, y, p) who stand at a place with probability p, else far away, without doubt."""
    x, y, p = np.array(people, float).reshape(-1, 3).T
    near, far = PLACE + np.stack([x, y], -1) @ TURN.T, np.full((len(x), 2), 60.0)
    first = (p > 0.5)[:, None]
    path = np.stack([np.where(first, near, far), np.where(first, far, near)], 1)[:, :, None]
    weight = np.stack([np.maximum(p, 1 - p), np.minimum(p, 1 - p)], 1)
    predictions = Predictions(path[:, 0], path, weight, 0.1)
    return Forecast(0.0, np.arange(len(x)), np.zeros((len(x), 1, 2)), predictions)


def costs(commands, *people, way=None, choice=None, state=AHEAD, robot=ROBOT, limit=0.25):
    choice = settings() if choice is None else choice
    commands = np.array(commands, float)
    steps = Steps(choice.dt_s, commands.shape[1])
    planner = Planner(robot, course() if way is None else way, choice)
    return planner.costs(commands, placed(state), expected(forecast_of(*people), steps, 0.0), limit)


def straight(steps=STEPS, speed=1.0):
    return [[[speed, 0.0]] * steps]


# The terms of the cost


@pytest.mark.parametrize(("dt_s", "time_s"), [(0.1, 0.7), (0.2, 0.8)])
def test_the_time_to_the_goal_ends_within_0_3_m_of_it(dt_s, time_s):
    """At x = 0.6 m the goal at (0.83, 0.2) is 0.305 m away, at 0.7 m 0.239 m, at 0.8 m 0.202 m."""
    found = costs(straight(), way=course((0.83, 0.2)), choice=settings(dt_s))
    assert found.tolist() == pytest.approx([time_s])


@pytest.mark.parametrize(("dt_s", "steps"), [(0.1, 12), (0.2, 7)])
def test_what_is_left_of_the_way_takes_full_speed(dt_s, steps):
    """S dt + (7.5 - 1.2 x + 0.4 y) / 1.1 at the end of a way along (0.6, 0.8)."""
    state = (0.5, -0.3, math.atan2(0.8, 0.6), 1.0, 0.0)
    x, y = 0.5 + 0.6 * dt_s * steps, -0.3 + 0.8 * dt_s * steps
    found = costs(straight(steps), way=course(to_go=(7.5, -1.2, 0.4)), choice=settings(dt_s), state=state)
    assert found.tolist() == pytest.approx([dt_s * steps + (7.5 - 1.2 * x + 0.4 * y) / 1.1])


@pytest.mark.parametrize("dt_s", [0.1, 0.05])
def test_near_walls_every_second_and_metre_costs(dt_s):
    """c = 0.35 + 0.3 m; 0.55 + 0.1 x is less than that by 0.1 (1 - x) until x = 1."""
    x = dt_s * np.arange(1, 31)
    near = np.maximum(0.1 - 0.1 * x, 0.0).sum()
    found = costs(straight(30), way=course(wall=(0.55, 0.1, 0.0)), choice=settings(dt_s, wall_weight=1.7))
    assert found.tolist() == pytest.approx([30 * dt_s + 1.7 * dt_s * near])


@pytest.mark.parametrize(
    ("wall", "allowed"),
    [
        ((0.51, -0.1, 0.0), False),  # 0.39 m at the end, less than 0.35 + 0.05 m
        ((0.53, -0.1, 0.0), True),
        ((0.30, 0.01, 0.0), True),  # who is too near may drive away
        ((0.30, 0.0, 0.01), True),  # and along
        ((0.30, -0.01, 0.0), False),
        ((0.395, 0.1, 0.0), True),
        ((-0.2, 0.01, 0.0), True),
    ],
)
def test_no_manoeuvre_comes_nearer_to_a_wall_that_is_near(wall, allowed):
    assert np.isfinite(costs(straight(), way=course(wall=wall))).tolist() == [allowed]


@pytest.mark.parametrize(
    ("robot", "state", "change"),
    [
        (ROBOT, (0.0, 0.0, 0.0, 0.7, -0.4), 0.3 / 1.1 + 0.6 / 1.7),
        (ROBOT, (0.0, 0.0, 0.0, 1.1, 0.9), 0.1 / 1.1 + 0.7 / 1.7),
        (HOLONOMIC, (0.0, 0.0, 0.0, 0.7, -0.4), 0.3 / 1.1 + 0.6 / 1.1),
    ],
)
def test_a_change_of_the_command_costs_its_share_of_the_limit(robot, state, change):
    """The first command is (1.0, 0.2), the others do not matter."""
    commands = [[[1.0, 0.2], *[[0.3, -0.1]] * 11]]
    found = costs(commands, choice=settings(change_weight=0.8), state=state, robot=robot)
    assert found.tolist() == pytest.approx([1.2 + 0.8 * change])


def test_overlaps_beyond_the_goal_do_not_cost_and_walls_do():
    """The goal is reached with the 7th of 12 steps; two people are there with 0.1, later one for sure."""
    people = [(x, 0.3, 0.1) for x in (0.0, 0.7)] + [(1.85, 0.0, 1.0)]
    choice = settings(exposure_weight=2.0, wall_weight=3.0)
    x = 0.1 * np.arange(1, 13)
    near = np.hypot(x[:, None] - [0.0, 0.7], 0.3) < 0.7
    risk = 1 - (1 - 0.1 * near).prod(axis=1)
    found = costs(straight(), *people, way=course((0.83, 0.2), (0.5, 0.0, 0.0)), choice=choice)
    assert found.tolist() == pytest.approx([0.7 + 0.1 * (2.0 * risk[:7].sum() + 3.0 * 12 * 0.15)])
    assert np.isinf(costs(straight(), *people, way=course((8.0, 0.2), (0.5, 0.0, 0.0)), choice=choice)).all()


# What is not allowed


@pytest.mark.parametrize(("p", "allowed"), [(0.2, True), (0.3, False)])
@pytest.mark.parametrize("x", [0.5, 1.0, 1.85])
def test_the_limit_is_for_whom_the_robot_drives_towards(x, p, allowed):
    """The last place is reached at the end only: 0.65 m before it."""
    found = costs(straight(), (x, 0.1, p))
    assert np.isfinite(found).tolist() == [allowed]
    assert np.isfinite(costs(straight(), (x, 0.1, p), limit=0.4)).all()


def test_who_is_behind_costs_and_is_not_limited():
    """0.55 and 0.65 m behind after the first steps, with 0.9: more than the limit."""
    found = costs(straight(), (-0.45, 0.0, 0.9), choice=settings(exposure_weight=2.0))
    assert found.tolist() == pytest.approx([1.2 + 2.0 * 0.1 * 2 * 0.9])


def test_manoeuvres_that_begin_alike_cost_what_each_costs_alone():
    """The second one fails in its fourth step, as the third does; the fourth brakes in that step."""
    stop, go, left, right = [0.0, 0.0], [1.0, 0.0], [0.6, 0.9], [0.6, -0.9]
    common = [
        [stop] * 12,
        [go] * 4 + [stop] * 8,
        [go] * 6 + [[0.8, 0.2]] * 6,
        [go] * 3 + [stop] * 9,
        [go] * 2 + [stop] * 10,
        [left] * 5 + [stop] * 7,
        [left] * 6 + [stop] * 6,
        [left] * 2 + [right] * 2 + [stop] * 8,
        [right] * 4 + [stop] * 8,
        [stop] * 3 + [go] * 2 + [stop] * 7,
        [stop] * 12,
        [go] * 2 + [stop] * 10,
        [stop] * 12,
    ]
    person, way = (1.075, 0.2, 0.9), course(wall=(0.5, 0.1, 0.05), to_go=(6.0, -1.0, 0.0))
    choice = settings(exposure_weight=2.0, wall_weight=3.0, change_weight=0.4)
    robot = Robot("differential", **(LIMITS | {"braking_mps2": 9.0}))
    options = {"way": way, "choice": choice, "robot": robot, "limit": 0.5}
    together = costs(common, person, (0.1, 0.5, 0.4), **options)
    alone = [costs([one], person, (0.1, 0.5, 0.4), **options)[0] for one in common]
    np.testing.assert_array_equal(together, alone)
    assert np.flatnonzero(np.isinf(together)).tolist() == [1, 2, 6]


# The choice


class Watched(Planner):
    """Keeps what it chooses among."""

    def costs(self, commands, state, people, limit):
        self.seen = commands, people, limit
        self.found = super().costs(commands, state, people, limit)
        return self.found


def first_command(state, *people, way=None, robot=ROBOT, **weights):
    planner = Watched(robot, course() if way is None else way, settings(**{"horizon_s": 2.0} | weights))
    chosen = planner.command(placed(state), forecast_of(*people), 0.0)
    assert np.array_equal(chosen, planner.seen[0][np.argmin(planner.found), 0])
    return chosen.tolist()


EAST = (6.0, -1.0, 0.0)
"""The way left is 6 - x."""


def test_where_nothing_is_allowed_it_brakes():
    """Somebody is surely ahead within the way that braking takes; and there is no wall-free way."""
    assert first_command(AHEAD, (0.75, 0.0, 1.0), way=course(to_go=EAST)) == [0.0, 0.0]
    assert first_command(AHEAD, way=course(wall=(0.3, -0.1, 0.0), to_go=EAST)) == [0.0, 0.0]


def test_the_manoeuvre_under_way_is_offered_again_one_step_later():
    planner = Watched(ROBOT, course(to_go=(6.0, -1.0, -0.7)), settings(horizon_s=2.0))
    planner.command(placed(AHEAD), forecast_of(), 0.0)
    commands, chosen = planner.seen[0], planner.seen[0][np.argmin(planner.found)]
    assert not commands[-1].any()
    assert chosen.any()
    planner.command(placed(AHEAD), forecast_of(), 0.0)
    np.testing.assert_array_equal(planner.seen[0][:-1], commands[:-1])
    np.testing.assert_array_equal(planner.seen[0][-1], [*chosen[1:], [0.0, 0.0]])


@pytest.mark.parametrize(
    ("dt_s", "horizon_s", "first_s", "first", "hold"),
    [(0.1, 2.0, 0.33, 3, 12), (0.2, 2.2, 0.5, 2, 6), (0.1, 2.0, 5.0, 12, 12)],
)
def test_a_manoeuvre_ends_with_the_time_to_brake_and_a_step(dt_s, horizon_s, first_s, first, hold):
    """1.1 / 1.6 = 0.6875 s: 7 steps of 0.1 s or 4 of 0.2 s, and one."""
    planner = Watched(ROBOT, course(), settings(dt_s, horizon_s=horizon_s, first_s=first_s))
    planner.command(placed(AHEAD), forecast_of(), 0.0)
    used = planner.seen[0].any(axis=2)
    assert used.shape[1] == round(horizon_s / dt_s)
    assert {len(one) - int(np.argmax(one[::-1])) for one in used if one.any()} == {first, hold}
    turns = np.unique(np.nonzero(np.diff(planner.seen[0][:, :hold], axis=1).any(axis=2))[1])
    assert turns.tolist() == [first - 1] * (first < hold)


@pytest.mark.parametrize(("speed_mps", "fits"), [(1.28, True), (1.29, False)])
def test_a_robot_needs_a_step_at_full_speed(speed_mps, fits):
    """1.6 m/s^2 in 8 of 10 steps of 0.1 s: at most 1.28 m/s."""
    robot = Robot("differential", **(LIMITS | {"speed_mps": speed_mps}))
    if fits:
        assert check_braking(robot, settings(horizon_s=1.0)) is None
        return
    with pytest.raises(ValueRuleError):
        check_braking(robot, settings(horizon_s=1.0))


def test_the_planner_asks_for_its_steps_its_limit_and_the_noise():
    planner = Watched(ROBOT, course(), settings(0.2, horizon_s=2.2, risk=0.17))
    path = np.array([[[[0.5, 2.0], [0.8, 2.3]]]])
    covariance = np.array([[[[[0.1, 0.03], [0.03, 0.2]]] * 2]])
    predictions = Predictions(path[:, 0], path, np.ones((1, 1)), 0.3, covariance)
    forecast = Forecast(0.0, np.arange(1), np.ones((1, 2, 2)), predictions)
    planner.command(placed(AHEAD), forecast, 0.4)
    _, people, limit = planner.seen
    assert limit == 0.17
    for found, own in zip(people, expected(forecast, Steps(0.2, 11), 0.4), strict=True):
        np.testing.assert_array_equal(found, own)
    assert people.covariance[0, 0, 0, 0] == pytest.approx(0.16 / 3 + 0.2 / 3)


def test_a_holonomic_robot_is_offered_the_way_of_its_course():
    """The way left, 0.3 x^2 + 0.2 y^2, falls along (-0.6 x, -0.4 y) = (0.45, -0.5) at a centre of cells."""
    x, y = np.meshgrid(-4.0 + 0.5 * (np.arange(20) + 0.5), -3.0 + 0.5 * (np.arange(16) + 0.5), indexing="ij")
    planner = Watched(HOLONOMIC, course()._replace(to_go=0.3 * x**2 + 0.2 * y**2), settings(horizon_s=2.0))
    planner.command((-0.75, 1.25, 0.0, 0.0, 0.0), forecast_of(), 0.0)
    ahead = 1.1 * np.array([0.45, -0.5]) / math.hypot(0.45, 0.5)
    assert np.hypot(*(planner.seen[0][:, 0] - ahead).T).min() < 1e-9


def test_the_first_step_of_the_manoeuvre_is_commanded():
    """It turns left for one step only, since the way left falls a little along y."""
    planner = Watched(ROBOT, course(to_go=(6.0, -1.0, -0.02)), settings(horizon_s=2.0, first_s=0.1))
    chosen = planner.command(placed(STILL), forecast_of(), 0.0)
    best = planner.seen[0][np.argmin(planner.found)]
    assert best[0].tolist() != best[1].tolist()
    assert chosen.tolist() == best[0].tolist()
