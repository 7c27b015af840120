"""Laws of the closed loop: who is at fault, what is found between frames, who sees the future."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.driving.course import course_to, route, walls_of
from pedpred.driving.crowds import RecordedPeople, ReplayedCrowd
from pedpred.driving.episodes import DriveSettings, Episode, EpisodeSettings, Place, draw_episode
from pedpred.driving.forecasters import NAMES, TRUTH, forecaster_of
from pedpred.driving.loop import drive
from pedpred.driving.measures import find_contacts, measure
from pedpred.driving.robot import KINDS, Robot
from pedpred.driving.sensor import Faults, RobotSensor, visible
from pedpred.driving.tracked import TrackedPeople
from pedpred.errors import ValueRuleError
from pedpred.online import OnlinePredictor
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from tests.worlds import blocked, empty_map

DT_S = 0.1
EXACT = RobotSensor(noise_m=0.0, missed=0.0)
CALM = DriveSettings(sensor=EXACT)


@pytest.fixture(scope="module")
def predictor():
    return OnlinePredictor.load()


def window_of(paths, first_s=10.0, goal=None):
    """People who have been there for a while, and go to the ends of their paths; paths: [T, N, 2]."""
    ticks, people = paths.shape[:2]
    there_s = first_s + np.arange(ticks)[:, None] * DT_S + np.zeros(people)
    return ReplayedCrowd(DT_S, np.arange(people), paths, there_s, paths[-1] if goal is None else goal)


def straight(places, velocities, ticks=400):
    """People who walk straight on."""
    seconds = np.arange(ticks)[:, None, None] * DT_S
    return window_of(np.array(places, float)[None] + seconds * np.array(velocities, float))


NOBODY = window_of(np.zeros((400, 0, 2)))


def episode_to(goal, window=NOBODY, start=(-4.0, 0.0), ground=None, watching=20, ticks=300):
    """A drive from a start to a goal; without `ground` on free ground."""
    walls = walls_of(empty_map() if ground is None else ground)
    course = course_to(np.array(goal, float), walls, Robot().radius_m)
    start = np.array(start, float)
    heading = float(np.arctan2(*(np.array(goal) - start)[::-1]))
    people = len(window.track_id)
    faults = Faults(np.zeros((ticks, people, 2)), np.ones((ticks, people)))
    length_m = float(np.hypot(*(course.goal - start))) - 0.3
    return Episode(0, 0, start, heading, course, length_m, watching, window, faults, ticks)


def driven(predictor, method, episode, choice=CALM, ground=None):
    place = empty_map() if ground is None else ground
    crowd = episode.crowd()
    return drive(episode, crowd, forecaster_of(method, predictor, place, crowd), place, choice)


def kind_of(name):
    return replace(CALM, robot=Robot(name))


# The robot and its way


@pytest.mark.parametrize("kind", KINDS)
def test_an_empty_world_takes_the_straight_time(predictor, kind):
    choice = kind_of(kind)
    episode = episode_to((4.0, 0.0))
    done = driven(predictor, "modes", episode, choice)
    robot = choice.robot
    speeding_up_s = robot.speed_mps / robot.acceleration_mps2 / 2
    found = measure(done, episode.route_m, robot, walls_of(empty_map()))
    assert found.success
    assert found.time_s == pytest.approx(episode.route_m / robot.speed_mps + speeding_up_s, abs=2 * DT_S)
    assert found.path_ratio == pytest.approx(1.0, abs=robot.speed_mps * DT_S / episode.route_m)


@pytest.mark.parametrize("kind", KINDS)
def test_a_robot_drives_around_a_wall_without_touching_it(predictor, kind):
    ground = blocked(np.s_[95:105, 60:130])
    choice = kind_of(kind)
    done = driven(predictor, "kalman", episode_to((4.0, 0.0), ground=ground), choice, ground)
    found = measure(done, 8.0, choice.robot, walls_of(ground))
    assert (found.reached, found.wall_contacts) == (1, 0)


def test_a_goal_in_or_behind_walls_has_no_route():
    """Around the end of a wall there is one, and not to the inside of a ring."""
    ring = blocked(np.s_[120:160, 80:120])
    inner = ring.occupied.copy()
    inner[125:155, 85:115] = False
    ring, wall = replace(ring, occupied=inner), blocked(np.s_[95:105, 40:])
    places = {(4.0, 0.0): ring, (0.0, 3.5): wall, (500.0, 0.0): wall, (-1e8, 1e8): wall}
    for goal, ground in places.items():
        course = course_to(np.array(goal), walls_of(ground), 0.3)
        assert not len(route(course, np.array([-4.0, 0.0]), 0.3)), goal
    around = course_to(np.array([4.0, 0.0]), walls_of(wall), 0.3)
    assert len(route(around, np.array([-4.0, 0.0]), 0.3)) > 100


# The loop

CROSSING = straight([(0, 4), (1, -5), (3, 3)], [(0, -1.0), (-0.2, 1.2), (-1.0, -0.5)])


@pytest.mark.parametrize("kind", KINDS)
def test_the_true_future_hits_nobody_whom_standing_people_hit(predictor, kind):
    """People who cross the way, many of them: standing forecasts run into them, the true future does not."""
    rng = np.random.default_rng(3)
    count, faults = 14, dict.fromkeys(("standing", TRUTH), 0)
    for _ in range(4):
        places = rng.uniform((-2, -9), (3, 9), (count, 2))
        velocities = np.stack([rng.normal(0, 0.2, count), -np.sign(places[:, 1]) * 1.2], axis=-1)
        episode = episode_to((4.0, 0.0), straight(places, velocities))
        for method in (method for method in faults if not faults[method]):
            done = driven(predictor, method, episode, kind_of(kind))
            faults[method] += int(find_contacts(done, 0.3).fault.sum())
    assert faults[TRUTH] == 0
    assert faults["standing"] > 0


@pytest.mark.parametrize("method", NAMES)
def test_only_the_named_forecaster_sees_the_future(predictor, method):
    """Where people turn at an instant changes no command before it, except by the true future.

    Those who turn have the same goals: social forces know these, and nothing else of the future.
    """
    turned = CROSSING.path.copy()
    at = 35
    turned[at:] = turned[at - 1] + (turned[at:] - turned[at - 1])[..., ::-1] * (1.0, -1.0)
    turned = window_of(turned, goal=CROSSING.goals)
    one, other = (
        driven(predictor, method, episode_to((4.0, 0.0), window, ticks=at)) for window in (CROSSING, turned)
    )
    same = np.array_equal(one.state, other.state)
    assert same == (method != TRUTH)


@pytest.mark.parametrize(
    ("kind", "method"),
    [
        ("differential", "modes"),
        ("holonomic", TRUTH),
    ],
)
def test_mirrored_worlds_give_mirrored_drives(predictor, kind, method):
    """A robot of another kind plans with the same forecasts: one with modes and covariances, one exact."""
    ground = blocked(np.s_[110:115, 70:90])
    mirror = replace(ground, occupied=ground.occupied[:, ::-1].copy())
    other = window_of(CROSSING.path * (1.0, -1.0))
    goal = np.array([4.0, 0.37])
    one = driven(predictor, method, episode_to(goal, CROSSING, ground=ground), kind_of(kind), ground)
    two = episode_to(goal * (1.0, -1.0), other, ground=mirror)
    two = driven(predictor, method, two, kind_of(kind), mirror)
    np.testing.assert_allclose(one.state[:, :2], two.state[:, :2] * (1.0, -1.0), atol=1e-6)


@pytest.mark.parametrize("method", ["modes", "social_force"])
def test_without_detections_a_robot_arrives(predictor, method):
    blind = replace(CALM, sensor=replace(EXACT, range_m=0.01))
    assert driven(predictor, method, episode_to((0.0, 0.0), CROSSING), blind).reached


def test_a_track_lasts_up_to_its_longest_gap(predictor):
    """Whatever the last digit of the clock says; after one more instant it is somebody new, who stands."""
    lost = round(predictor.protocol.lost_after_s / DT_S)
    for first in range(1, 60):
        for gap, moves in ((lost, True), (lost + 1, False)):
            people = TrackedPeople(predictor)
            for tick in (first - 1, first, first + gap):
                seen = people.follow(tick * DT_S, np.array([7]), np.array([[0.1 * tick, 0.0]]))
            assert np.isclose(seen.velocity[0, 0], 0.0) != moves


def test_social_forces_turn_to_the_goal_around_a_wall(predictor):
    """Somebody walks towards a wall; the goal is behind its end."""
    ground = blocked(np.s_[110:125, 80:120])
    crowd = replace(straight([(-3.0, -1.0)], [(1.2, 0.0)], 40), goals=np.array([[4.0, -4.0]]))
    forecasts = {name: forecaster_of(name, predictor, ground, crowd) for name in ("social_force", "kalman")}
    for tick in range(25):
        found = {
            name: one.update(tick * DT_S, crowd.track_id, crowd.position) for name, one in forecasts.items()
        }
        crowd.advance()
    assert ground.is_occupied(found["kalman"].position).any()
    assert not ground.is_occupied(found["social_force"].position).any()
    assert found["social_force"].position[0, -1, 1] < -1.2


# The sensor


def test_walls_and_people_hide_who_is_behind_them():
    ground = blocked(np.s_[110:112, 95:105])
    position = np.array([[3.0, 0.0], [0.0, 3.0], [0.0, 5.0], [-3.0, 0.0], [0.0, -11.0], [np.nan, np.nan]])
    here, back = (0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, np.pi, 0.0, 0.0)
    ahead = replace(EXACT, view_rad=np.pi / 2)
    assert np.flatnonzero(visible(here, position, ground, EXACT)).tolist() == [1, 3]
    assert visible(here, position, ground, replace(EXACT, occluded=False)).sum() == 4
    assert np.flatnonzero(visible(back, position, ground, ahead)).tolist() == [3]


@given(seed=st.integers(0, 10_000), cell_m=st.sampled_from([0.01, 0.02, 0.05, 0.1]))
@settings(max_examples=40, deadline=None)
def test_a_wall_one_cell_thick_hides_who_is_behind_it(seed, cell_m):
    """Also where its cells touch by corners alone; but nobody before it, or who leans on it."""
    rng = np.random.default_rng(seed)
    cells, corner = round(8.0 / cell_m), np.full(2, -4.0) + rng.uniform(0.0, cell_m, 2)
    straight, aslant = (np.zeros((cells, cells), bool) for _ in range(2))
    straight[round(5.0 / cell_m)] = True
    np.fill_diagonal(aslant[round(1.0 / cell_m) :], True)  # along y = x - 1 m, m
    alone = replace(EXACT, body_m=0.0)  # people do not hide each other
    state = (*rng.uniform(-0.3, 0.3, 2), 0.0, 0.0, 0.0)
    across, along = rng.uniform(-1.0, 1.0, (2, 50))
    behind = np.stack([rng.uniform(1.5, 3.0, 50), across], axis=1)
    before = np.stack([rng.uniform(0.4, 0.9, 50), across], axis=1)
    beside = np.stack([np.full(50, corner[0] + 5.1), 0.2 * across], axis=1)
    ground = OccupancyMap(straight, corner, cell_m)
    assert not visible(state, behind, ground, alone).any()
    assert visible(state, before, ground, alone).all()
    assert visible(state, beside, ground, alone).all()
    behind = np.stack([1.0 + along, along - 0.6], axis=1)
    assert not visible(state, behind, OccupancyMap(aslant, corner, cell_m), alone).any()


# Recorded people and episodes


def crossing_scene(seconds=60.0):
    """People who cross a free place in both directions, one every two seconds."""
    rows = []
    for n in range(int(seconds / 2)):
        side = 1 if n % 2 else -1
        for k in range(40):
            rows.append((2.0 * n + 0.25 * k, n, -6 * side + side * 0.3 * k, 0.1 * (n % 7) - 0.3))
    time_s, track, x, y = np.array(rows).T
    return Scene("crossing", Trajectories(time_s, track, np.stack([x, y], axis=-1)), empty_map(), 0.25)


def test_people_are_where_they_were_recorded():
    trajectories = crossing_scene().trajectories
    window = RecordedPeople(trajectories, DT_S).window(0, 100)
    for time_s in (0.0, 0.5, 4.0):
        path = window.path[round(time_s / DT_S)]
        here = trajectories.position[trajectories.time_s == time_s]
        np.testing.assert_allclose(path[np.isfinite(path[:, 0])], here, atol=1e-9)


def test_an_episode_depends_on_seed_and_number_only():
    place = Place.of(crossing_scene(), DT_S)
    first, again, *others = (
        draw_episode(place, number, DriveSettings(seed=seed))
        for number, seed in ((3, 0), (3, 0), (4, 0), (3, 1))
    )
    assert first.tick == again.tick
    assert np.array_equal(first.faults.noise, again.faults.noise)
    assert not any(np.array_equal(first.start, other.start) for other in others)


def test_a_place_where_nobody_can_be_met_is_refused():
    place = Place.of(crossing_scene(2.0), DT_S)
    far = DriveSettings(episodes=EpisodeSettings(distance_m=(50.0, 60.0)))
    for choice in (far, DriveSettings(robot=Robot(radius_m=8.0))):
        with pytest.raises(ValueRuleError):
            draw_episode(place, 0, choice, tries=1000)


def test_ground_that_would_fill_the_memory_is_refused():
    """As of one stray detection, where no map says how large the place is."""
    with pytest.raises(ValueRuleError):
        walls_of(OccupancyMap.free_around(np.array([[0.0, 0.0], [5e4 - 2, 5e4 - 2]])))
