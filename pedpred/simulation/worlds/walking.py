"""The compiled loop that moves the people of a world: two walking models, headway, groups, stops.

Pedestrian n wants to walk at v0 in direction e, the route's direction turned by a wandering angle. With r the
vector from another pedestrian m to n, d = |r|, d_w the distance to the nearest obstacle and n_w its gradient:

Social forces (Helbing & Molnar 1995, eq. 2-9, with the border's exponential), with bodies that repel:
    a = (w e - v) / tau + sum f(r) s(e, f) + sum_{d < l} 20 (l - d) r / d + U0 / R exp(-d_w / R) n_w
Collision-free speed model (Tordeux, Chraibi & Seyfried 2016), with inertia of direction and speed:
    u = e + sum a exp((l - d) / D) s r / d + a_w exp((r_n - d_w) / D_w) n_w
    de'/dt = (u / |u| - e') / 0.3 s,  a = (w (1 + c) / 2 e' / |e'| - v) / tau,  c = e . e' / |e'|

Here l = r_n + r_m is the sum of the radii, s the weight of what is seen, and the speed w is limited by the
headway T: w <= max(0, d - l) / T for everybody ahead within 0.95 l of the own line. w is 0 during a stop;
wander and speed are Ornstein-Uhlenbeck processes. Members of a group slow down or hurry to stay level
and are pulled to 0.5 to 0.9 m beside the others.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pedpred.compiled import compiled
from pedpred.simulation.ground import Ground
from pedpred.simulation.physics import SMALLEST_AXIS_M, border, ellipse_axis, way
from pedpred.simulation.routing import Routes
from pedpred.simulation.worlds.journeys import Journeys
from pedpred.simulation.worlds.models import WalkingModel
from pedpred.simulation.worlds.people import Traits

SPEED_CAP = 1.3  # largest speed, as a share of the desired one
_RANGE_M = 3.0  # repulsion from beyond is neglected
_GROUP_RANGE_M = (0.6, 8.0)  # nearer members repel each other, farther ones are lost
_SIGHT_COSINE = math.cos(math.radians(100.0))
_SMALL = 1e-9
_TURN_S = 0.3
_BODY_PUSH = 20.0  # 1/s^2
_AHEAD_M = 4.0
_ENTRY_SPEED = 0.8  # of people who come in, as a share of the desired one
_FIRST_S = 0.3  # people who are there from the start have any speed up to the desired one
_SPEED_S = 3.0  # correlation time of the desired speed
_BESIDE_M = (0.5, 0.9)
_TOUCH_M = 0.08  # nobody walks towards an obstacle that is closer
_EDGE_CELLS = 0.4  # the interpolated distance may be 0.35 cells inside the corner of an occupied cell


class FixedWorld(NamedTuple):
    """What does not change while people walk."""

    journeys: Journeys
    traits: Traits
    model: WalkingModel
    ground: Ground
    routes: Routes


@compiled
def _unit(x, y):
    length = math.sqrt(x * x + y * y) + _SMALL
    return x / length, y / length


@compiled
def _is_free(x, y, people, position, spacing_m):
    """Whether none of some people is nearer to a place than a distance."""
    for n in people:
        r_x, r_y = position[n, 0] - x, position[n, 1] - y
        if r_x * r_x + r_y * r_y < spacing_m**2:
            return False
    return True


@compiled
def _start(n, now, state, world, rng):
    """Let a person who comes in walk towards its first target, or stand."""
    x, y = state.position[n, 0], state.position[n, 1]
    e_x, e_y = way(x, y, world.journeys.plan[n, 0], world.routes)
    state.desired[n, 0], state.desired[n, 1] = e_x, e_y
    state.wander[n, 0], state.wander[n, 1] = rng.standard_normal(), rng.standard_normal()
    if world.journeys.standing_s[n] > 0:
        state.until[n] = now + world.journeys.standing_s[n]
    else:
        speed = world.traits.desired_speed[n] * (_ENTRY_SPEED if now > _FIRST_S else rng.random())
        state.velocity[n, 0], state.velocity[n, 1] = speed * e_x, speed * e_y


@compiled
def _let_in(now, inside, state, world, rng):
    """Let in everybody whose time has come and whose place is free; return how many are inside then."""
    start_s, entry = world.journeys.start_s, world.journeys.entry
    for n in range(len(start_s)):
        if start_s[n] > now:
            break
        if state.since_s[n] <= now:
            continue
        people = state.people[:inside]
        if _is_free(entry[n, 0], entry[n, 1], people, state.position, world.model.spacing_m):
            state.since_s[n], state.people[inside] = now, n
            inside += 1
            _start(n, now, state, world, rng)
    return inside


@compiled
def _reach_target(n, now, state, world):
    """Switch to the next target if the present one is reached; return whether the last one is."""
    plan, leg, target = world.journeys.plan[n], state.leg[n], world.routes.target
    x = target[plan[leg], 0] - state.position[n, 0]
    y = target[plan[leg], 1] - state.position[n, 1]
    if x * x + y * y > world.model.reach_m**2:
        return False
    if leg + 1 >= len(plan) or plan[leg + 1] < 0:
        return True
    if world.journeys.pause_s[n, leg] > 0:
        state.until[n] = now + world.journeys.pause_s[n, leg]
    state.leg[n] = leg + 1
    return False


@compiled
def _decide(n, now, dt, renew, state, world, rng):
    """Update desired direction, wander, random acceleration and stops."""
    model, traits, target = world.model, world.traits, world.journeys.plan[n, state.leg[n]]
    x, y = way(state.position[n, 0], state.position[n, 1], target, world.routes)
    angle = model.wander_rad * state.wander[n, 0]
    cos, sin = math.cos(angle), math.sin(angle)
    state.desired[n, 0], state.desired[n, 1] = cos * x - sin * y, sin * x + cos * y
    for axis, time_s in enumerate((model.wander_s, _SPEED_S)):
        share = dt / time_s
        state.wander[n, axis] += math.sqrt(2 * share) * rng.standard_normal() - share * state.wander[n, axis]
        if renew:
            state.noise[n, axis] = model.noise_mps2 * rng.standard_normal()
    if state.until[n] <= now and rng.random() < traits.stop_rate_hz[n] * dt:
        state.until[n] = now + traits.stop_s[n] * rng.standard_exponential()


@compiled
def _push(n, m, x, y, d, state, traits, model):
    """Influence of person m on n at the vector (x, y) and distance d: on direction or acceleration."""
    e_x, e_y = state.desired[n, 0], state.desired[n, 1]
    bodies = traits.radius_m[n] + traits.radius_m[m]
    if model.collision_free:
        push = model.direction_push * math.exp((bodies - d) / model.direction_range_m) / d
        push *= 1.0 if -(x * e_x + y * e_y) > -0.2 * d else model.unseen_weight
        return push * x, push * y
    stride = model.anticipation_s * math.hypot(state.velocity[m, 0], state.velocity[m, 1])
    a_x, a_y = x - stride * state.desired[m, 0], y - stride * state.desired[m, 1]
    there = math.hypot(a_x, a_y)
    axis = ellipse_axis(d, there, stride**2)
    push = model.strength / model.range_m * math.exp(-axis / model.range_m) * (d + there) / (4 * axis)
    there = max(there, SMALLEST_AXIS_M)
    f_x, f_y = push * (x / d + a_x / there), push * (y / d + a_y / there)
    if -(e_x * f_x + e_y * f_y) < math.hypot(f_x, f_y) * _SIGHT_COSINE:
        f_x, f_y = f_x * model.unseen_weight, f_y * model.unseen_weight
    touch = _BODY_PUSH * max(bodies - d, 0.0) / d
    return f_x + touch * x, f_y + touch * y


@compiled
def _others(n, active, group, state, traits, model):
    """Sum of the influences on n; vector to the mean of its group, and how many members are near."""
    p_x, p_y, g_x, g_y, members = 0.0, 0.0, 0.0, 0.0, 0
    for m in active:
        if m == n:
            continue
        x, y = state.position[n, 0] - state.position[m, 0], state.position[n, 1] - state.position[m, 1]
        square = x * x + y * y
        if group[n] >= 0 and group[m] == group[n] and square < _GROUP_RANGE_M[1] ** 2:
            g_x, g_y, members = g_x - x, g_y - y, members + 1
            if square > _GROUP_RANGE_M[0] ** 2:
                continue
        if square <= _RANGE_M**2:
            f_x, f_y = _push(n, m, x, y, math.sqrt(square) + 1e-6, state, traits, model)
            p_x, p_y = p_x + f_x, p_y + f_y
    return p_x, p_y, g_x / max(members, 1), g_y / max(members, 1), members


@compiled
def _gap(n, active, e_x, e_y, position, radius_m):
    """Distance between the bodies of n and of the nearest person ahead, m; may be negative."""
    gap = 1e9
    for m in active:
        x, y = position[m, 0] - position[n, 0], position[m, 1] - position[n, 1]
        ahead, aside = x * e_x + y * e_y, abs(y * e_x - x * e_y)
        bodies = radius_m[n] + radius_m[m]
        if m != n and 0.0 < ahead <= _AHEAD_M and aside < 0.95 * bodies:
            gap = min(gap, math.sqrt(x * x + y * y) - bodies)
    return gap


@compiled
def _beside(to_x, to_y, e_x, e_y):
    """Direction, as a share of the pull, that brings a member beside its group at (to_x, to_y)."""
    aside = e_x * to_y - e_y * to_x
    side, far = np.sign(aside), abs(aside)
    pull = side * (min(max(far - _BESIDE_M[1], 0.0), 1.0) - 0.5 * max(_BESIDE_M[0] - far, 0.0))
    return -pull * e_y, pull * e_x


@compiled
def _accelerate(n, now, dt, active, state, world):
    """Write the acceleration of n, m/s^2."""
    traits, model, group = world.traits, world.model, world.journeys.group
    e_x, e_y = state.desired[n, 0], state.desired[n, 1]
    stands, speed = state.until[n] > now, traits.desired_speed[n]
    speed *= max(0.3, 1.0 + model.unsteady * state.wander[n, 1])
    p_x, p_y, g_x, g_y, members = _others(n, active, group, state, traits, model)
    distance, away_x, away_y = border(state.position[n, 0], state.position[n, 1], world.ground)
    f_x, f_y, w_x, w_y = p_x, p_y, e_x, e_y
    if model.collision_free:
        wall = model.wall_push * math.exp((traits.radius_m[n] - distance) / model.wall_range_m)
        u_x, u_y = _unit(e_x + p_x + wall * away_x, e_y + p_y + wall * away_y)
        state.turned[n, 0] += dt / _TURN_S * (u_x - state.turned[n, 0])
        state.turned[n, 1] += dt / _TURN_S * (u_y - state.turned[n, 1])
        w_x, w_y = _unit(state.turned[n, 0], state.turned[n, 1])
        speed, f_x, f_y = 0.5 * speed * (1.0 + w_x * e_x + w_y * e_y), 0.0, 0.0
    else:
        wall = model.border_strength / model.border_range_m
        wall *= math.exp(-max(distance, 0.0) / model.border_range_m)
        f_x, f_y = f_x + wall * away_x, f_y + wall * away_y
    if traits.headway_s[n] > 0:
        gap = _gap(n, active, w_x, w_y, state.position, traits.radius_m)
        speed = min(speed, max(0.0, gap / traits.headway_s[n]))
    if members > 0:
        speed *= min(1.25, max(0.4, 1.0 + 0.25 * (g_x * e_x + g_y * e_y)))
        b_x, b_y = _beside(g_x, g_y, e_x, e_y)
        f_x, f_y = f_x + traits.pull_mps2[n] * b_x, f_y + traits.pull_mps2[n] * b_y
    speed, shake, tau = 0.0 if stands else speed, 0.2 if stands else 1.0, traits.relaxation_s[n]
    state.acceleration[n, 0] = (speed * w_x - state.velocity[n, 0]) / tau + f_x + shake * state.noise[n, 0]
    state.acceleration[n, 1] = (speed * w_y - state.velocity[n, 1]) / tau + f_y + shake * state.noise[n, 1]


@compiled
def _step(n, dt, state, most, ground):
    """Semi-implicit Euler step with capped speed; along obstacles, never into them."""
    x, y = state.position[n, 0], state.position[n, 1]
    v_x = state.velocity[n, 0] + state.acceleration[n, 0] * dt
    v_y = state.velocity[n, 1] + state.acceleration[n, 1] * dt
    scale = min(1.0, most / (math.hypot(v_x, v_y) + _SMALL))
    v_x, v_y = v_x * scale, v_y * scale
    distance, away_x, away_y = border(x + v_x * dt, y + v_y * dt, ground)
    if distance < _TOUCH_M and distance < border(x, y, ground)[0]:
        away_x, away_y = _unit(away_x, away_y)
        into = min(v_x * away_x + v_y * away_y, 0.0)
        v_x, v_y = v_x - into * away_x, v_y - into * away_y
    if border(x + v_x * dt, y + v_y * dt, ground)[0] < _EDGE_CELLS * ground.resolution_m:
        v_x, v_y = 0.0, 0.0
    state.velocity[n, 0], state.velocity[n, 1] = v_x, v_y
    state.position[n, 0], state.position[n, 1] = x + v_x * dt, y + v_y * dt


@compiled
def walk_on(first, end, inside, robots, world, state, clock, rng):
    """Let people come, walk and leave; return how many are inside then.

    Args:
        first: number of the first step.
        end: number of the step after the last one.
        inside: how many people are there, see `State.people`.
        robots: how many of them, the first, are robots: others see them, and they go on at their velocity.
        world: a `FixedWorld`.
        state: a `State`, which is changed in place.
        clock: a `Clock`; random accelerations are held for `clock.hold` steps.
        rng: source of all randomness.
    """
    people, dt = state.people, clock.dt_s
    for step in range(first, end):
        now, renew = step * dt, step % clock.hold == 0
        inside = _let_in(now, inside, state, world, rng)
        z = robots
        while z < inside:
            n = people[z]
            if _reach_target(n, now, state, world) and world.model.leave:
                inside -= 1
                people[z] = people[inside]
                continue
            _decide(n, now, dt, renew, state, world, rng)
            z += 1
        for n in people[robots:inside]:
            _accelerate(n, now, dt, people[:inside], state, world)
        for n in people[:robots]:
            for k in range(2):
                state.position[n, k] += state.velocity[n, k] * dt
        for n in people[robots:inside]:
            _step(n, dt, state, SPEED_CAP * world.traits.desired_speed[n], world.ground)
    return inside


@compiled
def walk(world, state, clock, rng):
    """Simulate people who come, walk and leave; the arguments are those of `walk_on`.

    Returns:
        A row for everybody present after each `clock.every` steps: the number k of this record, at the time
        (k + 1) every dt [R], the person [R], its leg [R], and (x, y, v_x, v_y), m and m/s [R, 4].
    """
    records, inside, rows = clock.steps // clock.every, 0, 0
    most = records * len(state.people)
    keys, values = np.empty((most, 3), np.int32), np.empty((most, 4))
    for record in range(records):
        inside = walk_on(
            record * clock.every, (record + 1) * clock.every, inside, 0, world, state, clock, rng
        )
        for n in state.people[:inside]:
            keys[rows, 0], keys[rows, 1], keys[rows, 2] = record, n, state.leg[n]
            for k in range(2):
                values[rows, k], values[rows, k + 2] = state.position[n, k], state.velocity[n, k]
            rows += 1
    return keys[:rows, 0], keys[:rows, 1], keys[:rows, 2], values[:rows]
