"""One step of the two walking models of worlds beside plain formulas, for each axis."""

import math

import numpy as np
import pytest

from pedpred.simulation.crowd import Clock
from pedpred.simulation.worlds.journeys import Journeys, State
from pedpred.simulation.worlds.models import WalkingModel
from pedpred.simulation.worlds.people import Traits
from pedpred.simulation.worlds.walking import FixedWorld, walk_on
from tests.by_hand.grounds import OPEN, ground_of, routes_along

MODEL = WalkingModel(
    collision_free=False,
    strength=2.3,
    range_m=0.35,
    anticipation_s=0.8,
    border_strength=7.0,
    border_range_m=0.25,
    unseen_weight=0.4,
    direction_push=3.0,
    direction_range_m=0.45,
    wall_push=2.0,
    wall_range_m=0.3,
    noise_mps2=0.0,
    wander_rad=0.0,
    wander_s=1.0,
    unsteady=0.0,
    spacing_m=0.5,
    reach_m=0.3,
    leave=True,
)
FREE = MODEL._replace(collision_free=True)
POSITION = np.array([[-0.9, 1.07], [-0.62, 1.51], [-0.41, 0.72]])
VELOCITY = np.array([[0.9, -0.2], [-0.3, 0.5], [0.1, 1.4]])
E = np.array([[0.6, -0.8], [-0.28, 0.96], [0.0, 1.0]])
SPEED, TAU, RADIUS = np.array([1.1, 0.7, 1.5]), np.array([0.5, 0.8, 0.6]), np.array([0.2, 0.31, 0.24])


class Walk:
    """People who are there and want to walk along `e`, on ground without routes around anything."""

    def __init__(self, position, velocity, e, model=MODEL, ground=OPEN, speed=SPEED, group=None, **traits):
        count = len(position)
        usual = {"relaxation_s": TAU[:count], "radius_m": RADIUS[:count]}
        usual |= dict.fromkeys(("headway_s", "stop_rate_hz", "pull_mps2"), np.zeros(count))
        people = Traits(desired_speed=np.array(speed[:count]), stop_s=np.ones(count), **(usual | traits))
        nobody = np.full(count, -1) if group is None else np.array(group)
        plan = np.stack([np.arange(count), nobody * 0 - 1], axis=1)
        place = np.array(position, float)
        journeys = Journeys(np.zeros(count), place, plan, np.zeros((count, 2)), np.zeros(count), nobody)
        self.world = FixedWorld(journeys, people, model, ground, routes_along(*e))
        self.state = State.before(journeys)
        self.state.velocity[:] = velocity
        self.state.since_s[:] = 0.0
        self.state.people[:] = np.arange(count)
        self.state.desired[:] = e

    def on(self, dt_s=0.05, first=1, steps=1, robots=0):
        count = len(self.state.people)
        clock, rng = Clock(dt_s, 99, 1, 99), np.random.default_rng(0)
        inside = walk_on(first, first + steps, count, robots, self.world, self.state, clock, rng)
        assert inside == count
        return self.state


@pytest.mark.parametrize("model", [MODEL, FREE])
@pytest.mark.parametrize("dt_s", [0.05, 0.04])
@pytest.mark.parametrize("e", [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.6, -0.8)])
def test_speed_and_place_approach_the_desired_ones_by_hand(e, dt_s, model):
    """v(k) = v0 e + (v(0) - v0 e) (1 - dt / tau)^k and x(k) = x(0) + dt sum v(1..k), for each axis alone."""
    start, v, k = np.array([0.4, -0.7]), np.array([0.2, 0.1]), np.arange(1, 7)[:, None]
    walk, desired = Walk([start], [v], [e], model), 1.1 * np.array(e)
    expected = desired + (v - desired) * (1 - dt_s / 0.5) ** k
    for step in range(6):
        state = walk.on(dt_s, first=1 + step)
        np.testing.assert_allclose(state.velocity[0], expected[step], atol=1e-6)
        np.testing.assert_allclose(state.position[0], start + dt_s * expected[: step + 1].sum(0), atol=1e-6)


def drives():
    return (SPEED[:, None] * E - VELOCITY) / TAU[:, None]


def test_three_unequal_people_push_by_social_forces():
    """Helbing & Molnar 1995, eq. 3, 4, 7 and 8."""
    expected = drives()
    for n, m in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)]:
        r, y = POSITION[n] - POSITION[m], 0.8 * math.hypot(*VELOCITY[m]) * E[m]
        here, there = math.hypot(*r), math.hypot(*(r - y))
        b = 0.5 * math.sqrt((here + there) ** 2 - y @ y)
        f = 2.3 / 0.35 * math.exp(-b / 0.35) * (here + there) / (4 * b) * (r / here + (r - y) / there)
        seen = -(E[n] @ f) >= math.hypot(*f) * math.cos(math.radians(100.0))
        expected[n] += f * (1.0 if seen else 0.4)
    found = Walk(POSITION, VELOCITY, E).on(1e-3).acceleration
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


def test_bodies_that_overlap_push_at_20_per_second_squared():
    """l = 0.51 m and d = 0.4 m: 20 x 0.11 m/s^2 along (0.6, 0.8), without any other force."""
    position = [[1.0, 2.0], [1.24, 2.32]]
    walk = Walk(position, np.zeros((2, 2)), E[:2], MODEL._replace(strength=0.0), speed=[0.0, 0.0])
    push = 2.2 * np.array([0.6, 0.8])
    np.testing.assert_allclose(walk.on(1e-3).acceleration, [-push, push], atol=1e-4)


@pytest.mark.parametrize("dt_s", [0.05, 0.03])
def test_three_unequal_people_turn_by_the_collision_free_model(dt_s):
    """u = e + sum a exp((l - d) / D) s r / d; e' += dt (u / |u| - e') / 0.3 s;
    a = (v0 (1 + c) / 2 e' / |e'| - v) / tau.

    s is 1 for whom is within acos(-0.2) of e, else 0.4.
    """
    expected, turned = [], np.array([[0.9, 0.1], [-0.5, 0.4], [0.3, 0.8]])
    for n in range(3):
        u = E[n].copy()
        for m in {0, 1, 2} - {n}:
            r = POSITION[n] - POSITION[m]
            d = math.hypot(*r)
            seen = 1.0 if -(r @ E[n]) > -0.2 * d else 0.4
            u += 3.0 * math.exp((RADIUS[n] + RADIUS[m] - d) / 0.45) * seen * r / d
        way = turned[n] + dt_s / 0.3 * (u / math.hypot(*u) - turned[n])
        way /= math.hypot(*way)
        expected.append((SPEED[n] * (1 + way @ E[n]) / 2 * way - VELOCITY[n]) / TAU[n])
    walk = Walk(POSITION, VELOCITY, E, FREE)
    walk.state.turned[:] = turned
    np.testing.assert_allclose(walk.on(dt_s).acceleration, expected, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("d", [0.5, 0.2])
def test_walls_push_along_the_gradient_of_their_distance(d):
    """U0 / R exp(-d / R) n; in the collision-free model a exp((r - d) / D) n turns the direction."""
    away = np.array([0.28, 0.96])
    ground = ground_of(np.full((2, 2, 3), [d, *away]), cell_m=0.25)
    found = Walk(POSITION[:1], VELOCITY[:1], E[:1], MODEL, ground).on(1e-3).acceleration
    np.testing.assert_allclose(found, drives()[:1] + 7.0 / 0.25 * math.exp(-d / 0.25) * away, atol=1e-5)
    u = E[0] + 2.0 * math.exp((0.2 - d) / 0.3) * away
    u /= math.hypot(*u)
    found = Walk(POSITION[:1], VELOCITY[:1], E[:1], FREE, ground).on(1e-3).acceleration
    np.testing.assert_allclose(found[0], (1.1 * (1 + u @ E[0]) / 2 * u - VELOCITY[0]) / 0.5, atol=1e-5)


@pytest.mark.parametrize(
    ("ahead", "aside", "speed"),
    [
        (1.1, 0.3, (math.hypot(1.1, 0.3) - 0.51) / 0.9),
        (0.4, 0.1, 0.0),
        (3.9, 0.0, 1.1),
        (0.8, 0.48, (math.hypot(0.8, 0.48) - 0.51) / 0.9),
        (0.8, 0.49, 1.1),  # beside the own line by more than 0.95 x 0.51 m
        (-0.6, 0.1, 1.1),
    ],
)
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_people_keep_a_time_to_the_next_ahead(ahead, aside, side, speed):
    """w = min(v0, max(0, d - l) / T) with T = 0.9 s and l = 0.51 m."""
    other = POSITION[0] + ahead * E[0] + side * aside * np.array([0.8, 0.6])
    model = MODEL._replace(strength=0.0)
    walk = Walk([POSITION[0], other], VELOCITY[:2], E[:2], model, headway_s=np.array([0.9, 0.0]))
    away = math.hypot(ahead, aside)
    touch = 20.0 * max(0.51 - away, 0.0) * (POSITION[0] - other) / away
    expected = (speed * E[0] - VELOCITY[0]) / 0.5 + touch
    np.testing.assert_allclose(walk.on(1e-3).acceleration[0], expected, atol=1e-4)


@pytest.mark.parametrize(
    ("ahead", "aside", "pace", "pull"),
    [(0.8, 0.7, 1.2, 0.0), (-1.2, 1.3, 0.7, 0.4), (2.0, 0.3, 1.25, -0.1), (-4.0, -2.9, 0.4, 1.0)],
)
def test_members_of_a_group_come_level_and_beside_each_other(ahead, aside, pace, pull):
    """v0 times 1 + 0.25 of the metres ahead, 0.4 to 1.25; pulled aside beyond 0.9 m, away within 0.5 m."""
    left = np.array([0.8, 0.6])
    to = math.copysign(1.0, aside) * pull
    other, model = POSITION[0] + ahead * E[0] + aside * left, MODEL._replace(strength=0.0)
    walk = Walk(
        [POSITION[0], other], VELOCITY[:2], E[:2], model, group=[5, 5], pull_mps2=np.array([0.7, 0.3])
    )
    expected = (1.1 * pace * E[0] - VELOCITY[0]) / 0.5 + 0.7 * to * left
    np.testing.assert_allclose(walk.on(1e-3).acceleration[0], expected, atol=1e-4)


@pytest.mark.parametrize(("until_s", "speed", "shake"), [(9.0, 0.0, 0.2), (0.0, 1.1, 1.0)])
def test_who_stops_brakes_and_is_shaken_less(until_s, speed, shake):
    walk = Walk(POSITION[:1], VELOCITY[:1], E[:1])
    walk.state.until[0], walk.state.noise[0] = until_s, (0.6, -0.35)
    expected = (speed * E[0] - VELOCITY[0]) / 0.5 + shake * np.array([0.6, -0.35])
    np.testing.assert_allclose(walk.on(1e-3).acceleration[0], expected, atol=1e-5)


@pytest.mark.parametrize("v", [(3.0, 0.4), (-0.3, 2.6), (-1.5, -2.0)])
def test_nobody_is_faster_than_1_3_of_the_desired_speed(v):
    walk = Walk([[0.3, -0.2]], [v], [(0.6, -0.8)], relaxation_s=np.full(1, 1e12))
    state, fast = walk.on(0.04), 1.3 * 1.1 * np.array(v) / math.hypot(*v)
    np.testing.assert_allclose(state.velocity[0], fast, atol=1e-6)
    np.testing.assert_allclose(state.position[0], np.array([0.3, -0.2]) + 0.04 * fast, atol=1e-6)


def test_at_a_wall_the_part_into_it_is_lost():
    """d = 0.1 - 0.6 x - 0.8 y: 0.062 m after a step of 0.05 s; (1, 0.2) has 0.76 m/s into (0.6, 0.8)."""
    x, y = np.meshgrid(*[0.1 * (np.arange(10) + 0.5) - 0.5] * 2, indexing="ij")
    slope = np.stack([0.1 - 0.6 * x - 0.8 * y, np.full_like(x, -0.6), np.full_like(x, -0.8)], axis=-1)
    model, calm = MODEL._replace(border_strength=0.0), {"relaxation_s": np.full(1, 1e12)}
    for v, expected in (((1.0, 0.2), (0.544, -0.408)), ((-1.0, 0.2), (-1.0, 0.2)), ((0.2, 0.1), (0.2, 0.1))):
        walk = Walk([[0.0, 0.0]], [v], [(1.0, 0.0)], model, ground_of(slope, (-0.5, -0.5), 0.1), **calm)
        np.testing.assert_allclose(walk.on(0.05).velocity[0], expected, atol=1e-6)
        np.testing.assert_allclose(walk.state.position[0], 0.05 * np.array(expected), atol=1e-6)


def test_nobody_enters_the_cell_of_an_obstacle():
    """At less than 0.4 cells of 0.25 m from it everybody stands."""
    for d, factor in ((0.11, 1.0), (0.09, 0.0)):
        ground = ground_of(np.full((2, 2, 3), [d, 0.6, 0.8]), cell_m=0.25)
        calm = {"relaxation_s": np.full(1, 1e12)}
        walk = Walk(
            [[0.3, 0.2]], [[0.5, 0.3]], [(1.0, 0.0)], MODEL._replace(border_strength=0.0), ground, **calm
        )
        np.testing.assert_allclose(walk.on(0.05).velocity[0], factor * np.array([0.5, 0.3]), atol=1e-6)


@pytest.mark.parametrize("dt_s", [0.05, 0.04])
def test_a_robot_goes_on_at_its_velocity(dt_s):
    state = Walk(POSITION, VELOCITY, E).on(dt_s, steps=3, robots=2)
    np.testing.assert_allclose(state.position[:2], POSITION[:2] + 3 * dt_s * VELOCITY[:2], atol=1e-12)
    np.testing.assert_array_equal(state.velocity[:2], VELOCITY[:2])
