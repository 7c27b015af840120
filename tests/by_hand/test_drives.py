"""Contacts and measures of hand-made drives, beside numbers and plain formulas."""

import math

import numpy as np
import pytest

from pedpred.driving.course import Walls
from pedpred.driving.loop import Drive
from pedpred.driving.measures import find_contacts, measure
from pedpred.driving.robot import Robot

ROBOT = Robot(radius_m=0.4, speed_mps=1.1)
"""It touches people at 0.7 m: their bodies have a radius of 0.3 m."""
NOWHERE = [math.nan, math.nan]


def drive_of(path, people, dt_s=0.4, reached=True, there_s=5.0):
    """A robot on a path [T, 2] among people [N, T, 2]."""
    path, people = np.array(path, float), np.array(people, float).reshape(-1, len(path), 2).swapaxes(0, 1)
    state = np.concatenate([path, np.full((len(path), 3), 9.0)], axis=1)
    there = np.broadcast_to(there_s, people.shape[:2])
    return Drive(state, people, there, dt_s, reached, np.zeros(len(path) - 1))


def walls(*heights):
    """Distances to walls: as given at x = 0.5, 1.5 ... and y = 0; 0.1 m more for each metre along y."""
    y = -2.0 + np.arange(5) + 0.5
    return Walls(np.array([0.0, -2.0]), 1.0, np.array(heights)[:, None] + 0.1 * y)


FAR = walls(9.0, 9.0, 9.0)


def measured(path, people=(), route_m=2.0, ground=FAR, **given):
    return measure(drive_of(path, people, **given), route_m, ROBOT, ground)


# Contacts


def root(r, u):
    """The smaller root of |u|^2 f^2 + 2 r u f + |r|^2 - 0.7^2."""
    return np.roots([np.dot(u, u), 2 * np.dot(r, u), np.dot(r, r) - 0.49]).min()


PATH = [[1.0, 2.0], [1.3, 2.4], [1.4, 2.9], [1.4, 3.0]]
PEOPLE = [
    [[2.9, 2.2], [2.5, 2.3], [1.9, 2.5], [1.5, 2.9]],  # touches in the second interval
    [[1.2, 4.0], [1.5, 3.7], [1.5, 3.7], [1.4, 3.2]],  # in the third one
    [[1.1, 2.3], [1.3, 2.6], [1.5, 3.0], [1.4, 3.1]],  # is within the robot from the beginning
    [[1.3, 2.3], [2.4, 2.4], [1.3, 2.9], NOWHERE],  # comes back in the second one, then leaves
    [[0.1, 2.1], [0.5, 2.3], NOWHERE, [0.8, 3.0]],  # is not there in between
    [[-2.0, 1.0], [-1.0, 2.0], [-0.5, 3.0], [0.3, 2.9]],  # comes near, and does not touch
    [[2.2, 2.0], [1.7, 3.5], [2.4, 3.0], [2.4, 3.0]],  # passes by
    [[1.8, 2.0], [2.6, 2.4], [3.5, 3.0], [3.5, 3.1]],  # goes away
]


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_contacts_begin_where_the_distance_is_that_of_the_radii(dt_s):
    robot, people = np.array(PATH), np.array(PEOPLE)
    found = find_contacts(drive_of(PATH, PEOPLE, dt_s), 0.4)
    assert found.person.tolist() == [0, 3, 1]
    for z, (n, tick) in enumerate(((0, 1), (3, 1), (1, 2))):
        r, u = people[n, tick] - robot[tick], np.diff(people[n] - robot, axis=0)[tick]
        assert found.time_s[z] == pytest.approx((tick + root(r, u)) * dt_s)
        assert found.speed_mps[z] == pytest.approx(math.hypot(*u) / dt_s)
        at, velocity = r + root(r, u) * u, (robot[tick + 1] - robot[tick]) / dt_s
        assert found.fault[z] == (velocity @ at / 0.7 > 0.05)


@pytest.mark.parametrize(("aside_m", "ahead_m"), [(0.42, 0.56), (0.56, 0.42)])
def test_a_contact_in_plain_numbers(aside_m, ahead_m):
    """From 1.5 m ahead to 0.5 m behind in 0.4 s: 0.7 m away where `ahead_m` is left; the second passes."""
    y = 3.0 + aside_m
    found = find_contacts(drive_of([[1.0, 3.0], [1.5, 3.0]], [[[2.5, y], [1.0, y]]]), 0.4)
    assert found.time_s.tolist() == pytest.approx([0.4 * (1.5 - ahead_m) / 2])
    assert found.speed_mps.tolist() == pytest.approx([5.0])
    assert found.fault.tolist() == [True]


@pytest.mark.parametrize("begin_m", [1.2, 1.1, 1.0, 0.9, 0.73])
def test_a_contact_exactly_at_an_instant_counts_once(begin_m):
    """The person is 0.7 m away at the second instant and nearer at the third; it comes back later."""
    way = [[begin_m, 0.0], [0.7, 0.0], [0.6, 0.0], [1.3, 0.0], [0.7, 0.0], [0.8, 0.0]]
    found = find_contacts(drive_of([[0.0, 0.0]] * 6, [way]), 0.4)
    assert found.time_s.tolist() == pytest.approx([0.4, 1.6])


def test_who_touches_the_robot_at_first_has_no_contact_yet():
    """As those who are within it: the contact began before the drive."""
    way = [[0.7, 0.0], [0.6, 0.0], [0.9, 0.0], [0.5, 0.0]]
    found = find_contacts(drive_of([[0.0, 0.0]] * 4, [way]), 0.4)
    assert found.time_s.tolist() == pytest.approx([0.4 * 2.5])


@pytest.mark.parametrize(("speed_mps", "fault"), [(0.0, False), (0.047, False), (0.053, True), (-0.2, False)])
@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_the_robot_is_at_fault_if_it_moves_towards_who_is_hit(speed_mps, fault, dt_s):
    """The person is at (0.6, 0.8) of 0.7 m when hit; the robot moves along it, and at 0.9 m/s across."""
    to = np.array([0.6, 0.8])
    moved = dt_s * (speed_mps * to + 0.9 * np.array([-0.8, 0.6]))
    path = np.array([0.2, -0.3]) + np.stack([0.0 * moved, moved])
    share = 0.4
    first = path[0] + share * moved + 0.7 * to + share * 0.5 * to
    found = find_contacts(drive_of(path, [[first, first - 0.5 * to]], dt_s), 0.4)
    assert found.time_s.tolist() == pytest.approx([share * dt_s])
    assert found.fault.tolist() == [fault]


@pytest.mark.parametrize(("there_s", "fault"), [(0.9, False), (0.999, False), (1.0, True), (1.05, True)])
def test_who_has_just_come_is_nobodys_fault(there_s, fault):
    """At the beginning of the interval, and of that person."""
    there = np.array([[9.0, there_s - 0.4], [0.0, there_s], [9.0, there_s + 9.0]])
    people = [[[9.0, 9.0]] * 3, [[2.5, 0.0], [1.9, 0.0], [1.4, 0.0]]]
    found = find_contacts(drive_of([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]], people, there_s=there), 0.4)
    assert (found.person.tolist(), found.fault.tolist()) == ([1], [fault])


# Measures

DRIVEN = [[0.2, 0.1], [0.5, 0.5], [0.51, 0.51], [0.9, 0.2], [1.7, 0.3], [1.715, 0.305]]
"""Steps of 0.5, 0.0141, 0.498, 0.806 and 0.0158 m."""


@pytest.mark.parametrize(("dt_s", "stops"), [(0.3, 1), (0.4, 2)])
def test_time_path_and_stops_of_a_drive(dt_s, stops):
    """0.047 or 0.035 m/s is slow, and so is 0.053 or 0.0395 m/s in the last step."""
    found = measured(DRIVEN, route_m=1.6, dt_s=dt_s)
    steps = [0.5, 0.01 * math.sqrt(2), math.hypot(0.39, 0.31), math.hypot(0.8, 0.1), math.hypot(0.015, 0.005)]
    assert found.time_s == pytest.approx(5 * dt_s)
    assert found.time_ratio == pytest.approx(5 * dt_s * 1.1 / 1.6)
    assert found.path_ratio == pytest.approx(sum(steps) / 1.6)
    assert found.stopped_s == pytest.approx(stops * dt_s)
    assert (found.reached, found.success, found.wall_contacts) == (1, 1, 0)


def test_a_drive_that_does_not_arrive_has_no_ratio_of_paths():
    found = measured(DRIVEN, reached=False)
    assert math.isnan(found.path_ratio)
    assert (found.reached, found.success) == (0, 0)
    assert found.time_s == pytest.approx(2.0)


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_jerk_is_the_mean_change_of_acceleration(dt_s):
    """|p(t + 3) - 3 p(t + 2) + 3 p(t + 1) - p(t)| / dt^3, mean over three, which differ."""
    p = np.array(DRIVEN)
    third = p[3:] - 3 * p[2:-1] + 3 * p[1:-2] - p[:-3]
    assert measured(DRIVEN, dt_s=dt_s).jerk_mps3 == pytest.approx(np.hypot(*third.T).mean() / dt_s**3)
    assert measured(DRIVEN[:4], dt_s=dt_s).jerk_mps3 == pytest.approx(math.hypot(*third[0]) / dt_s**3)
    assert measured(DRIVEN[:3], dt_s=dt_s).jerk_mps3 == 0.0


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_gaps_are_between_edges_of_robot_and_person(dt_s):
    """The nearest are 0.41, 0.44, 0.7, nobody, 0.46 and 0.25 m away; less than 0.45 m intrudes."""
    gaps = [(0.41, 2.0), (2.5, 0.44), (0.7, None), (None, None), (0.46, 0.9), (3.0, 0.25)]
    to = [np.array([0.6, 0.8]), np.array([-0.28, 0.96])]
    people = [
        [
            NOWHERE if gap[k] is None else at + (gap[k] + 0.7) * to[k]
            for at, gap in zip(DRIVEN, gaps, strict=True)
        ]
        for k in (0, 1)
    ]
    found = measured(DRIVEN, people, dt_s=dt_s)
    assert found.nearest_m == pytest.approx(0.25)
    assert found.intrusion_s == pytest.approx(3 * dt_s)
    assert (found.contacts, found.faults) == (0, 0)


def test_without_people_nobody_is_near():
    found = measured(DRIVEN)
    assert (found.nearest_m, found.intrusion_s, found.fault_speed_mps) == (math.inf, 0.0, 0.0)
    gone = measured(DRIVEN, [[NOWHERE] * 6])
    assert (gone.nearest_m, gone.intrusion_s, gone.contacts) == (math.inf, 0.0, 0)


def test_collisions_at_fault_spoil_a_drive_and_others_do_not():
    """Relative speeds of 2.5 and 3.75 m/s at fault; the fastest one, of 10 m/s, hits from behind."""
    path = [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.5, 0.0]]
    ahead = [[1.5, 0.3], [1.0, 0.3], [1.0, 9.0], [1.0, 9.0]]
    later = [[9.0, 0.0], [9.0, 0.0], [2.6, -0.2], [1.6, -0.2]]
    behind = [[-9.0, 0.1], [-3.6, 0.1], [0.9, 0.1], [1.2, 0.1]]
    found = measured(path, [ahead, later, behind])
    assert (found.contacts, found.faults, found.reached, found.success) == (3, 2, 1, 0)
    assert found.fault_speed_mps == pytest.approx(3.75)
    assert found.nearest_m == pytest.approx(math.hypot(0.1, 0.1) - 0.7)
    only = measured(path, [behind])
    assert (only.contacts, only.faults, only.reached, only.success, only.fault_speed_mps) == (1, 0, 1, 1, 0.0)


def test_touching_a_wall_counts_when_it_begins():
    """0.25, 0.55, 0.39, 0.38, 0.41, 0.26, 0.47 and 0.35 m; below 0.4 m it touches, also at the beginning."""
    ground = walls(0.2, 0.5, 0.34, 0.33, 0.36, 0.3)
    path = [[0.5, 0.5], [1.5, 0.5], [2.5, 0.5], [3.5, 0.5], [4.5, 0.5], [4.5, -1.0], [1.5, -0.3], [5.5, 0.5]]
    assert measured(path, ground=ground).wall_contacts == 3
    assert measured(path[::-1], ground=ground).wall_contacts == 3
    assert measured(path[:3], ground=ground).wall_contacts == 1
    assert measured(path[:2], ground=ground).wall_contacts == 0
