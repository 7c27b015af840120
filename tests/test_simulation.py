"""Laws of the simulator, and the counts by which its walking is judged."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.report.canvas import png_bytes
from pedpred.report.simulation_page import crowd_section, walking_findings
from pedpred.scenes import Scene, Trajectories
from pedpred.simulation.crowd import crowd_of
from pedpred.simulation.ground import ground_of
from pedpred.simulation.layouts import draw_targets
from pedpred.simulation.routing import routes_to
from pedpred.simulation.settings import social_force_settings
from pedpred.simulation.simulator import draw_visiting_plans, rollout
from pedpred.simulation.validation import (
    FlowSettings,
    WalkingCounts,
    corridor_flow,
    count_walking,
    lane_order,
)
from pedpred.storage.tracks import tracks_table
from tests.refused import refused
from tests.simulated import (
    DRAWN,
    EMPTY_ROOM,
    SETTINGS,
    SOCIAL_FORCE,
    drawn,
    pool,
    read,
    scene_of,
    short,
    with_field,
)


def tables_equal(first, second):
    return tracks_table(first.trajectories).equals(tracks_table(second.trajectories))


def ways_in(name, seed):
    """The ground of a drawn layout, its targets and the routes to them."""
    ground, rng = ground_of(drawn(name).occupancy()), np.random.default_rng(seed)
    targets = draw_targets(drawn(name), ground, SETTINGS.crowd, rng)
    return ground, targets, routes_to(targets.position, ground, SETTINGS.routing)


@pytest.mark.parametrize("name", sorted(DRAWN))
def test_a_lone_slow_pedestrian_reaches_every_target(name):
    ground, targets, routes = ways_in(name, seed=0)
    targets = targets.position
    plan = np.arange(len(targets))[None]
    slowest = np.array([SETTINGS.crowd.speed_range_mps[0]])
    crowd = crowd_of(targets[-1:], np.zeros((1, 2)), slowest, plan)
    path = rollout(crowd, ground, routes, SETTINGS, 6000, 0.3)[0]
    nearest = np.linalg.norm(path[:, None] - targets, axis=-1).min(axis=0)
    assert nearest.max() <= SETTINGS.crowd.reach_m + 0.3 * slowest[0]


def test_people_in_random_rooms_walk_as_people_do():
    rooms = short(40.0, drawn=["doorways", "plaza", "bottleneck"], generated=2)
    found = count_walking([scene_of(room) for room in rooms], SETTINGS)
    assert found.targets > 100
    assert [finding for finding in walking_findings(found.shares()) if finding.verdict != "met"] == []


def test_the_same_seed_gives_the_same_walk():
    first, again, other = (scene_of(short(6.0, seed=seed)[0]) for seed in (7, 7, 8))
    assert tables_equal(first, again)
    assert not tables_equal(first, other)


def test_random_accelerations_last_as_long_at_any_step():
    changes = []
    for step_s in (0.05, 0.025):
        clock = SOCIAL_FORCE["clock"] | {"step_s": step_s, "noise_mps2": 2.0}
        walked = scene_of(short(6.0)[0], social_force_settings(SOCIAL_FORCE | {"clock": clock}))
        changes.append(np.diff(walked.trajectories.velocity.reshape(-1, 20, 2), axis=0).std())
    assert changes[1] == pytest.approx(changes[0], rel=0.1)


def test_a_target_in_an_enclosed_corner_is_moved():
    occupancy = EMPTY_ROOM.occupancy()
    occupied = occupancy.occupied.copy()
    occupied[30:38, 30:38] = True
    occupied[32:36, 32:36] = False  # 0.4 m x 0.4 m
    ground = ground_of(replace(occupancy, occupied=occupied))
    inside = occupancy.origin + 0.1 * np.array([34.0, 34.0])
    routes = routes_to(inside[None], ground, replace(SETTINGS.routing, narrow_m=0.05))
    assert not occupied[tuple(((routes.target[0] - occupancy.origin) / 0.1).astype(int))]
    assert 0.3 < np.linalg.norm(routes.target[0] - inside) < 1.0


def test_plans_go_to_another_region_far_enough():
    targets = pool([0.0, 0.0], [1.0, 0.0], [12.0, 0.0])
    plans = draw_visiting_plans(targets, 5, 50, 10.0, np.random.default_rng(0))
    legs = np.linalg.norm(np.diff(targets.position[plans], axis=1), axis=-1)
    assert legs.min() > 10.0


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("clock.record_s", 0.32),
        ("clock.noise_hold_s", 0.01),
        ("forces.relaxation_time_s", 0.04),
        ("crowd.speed_range_mps", [2.0, 3.0]),
        ("routing.narrow_m", 0.9),
    ],
)
def test_settings_that_contradict_each_other_are_named(path, value):
    with refused(path):
        social_force_settings(with_field(path, value))


# What is counted of walking

FLOW = FlowSettings(**{k: v for k, v in read("validation/corridor_flow").items() if k != "social_force"})


def walked(paths, goals, dt_s=0.3):
    """A scene in which all people are present at all instants; velocities are backward differences."""
    position, goal = (np.swapaxes(np.array(a, dtype=float), 0, 1) for a in (paths, goals))
    velocity = np.diff(position, axis=0, prepend=2 * position[:1] - position[1:2]) / dt_s
    instants, people, _ = position.shape
    time_s, track = np.repeat(np.arange(instants) * dt_s, people), np.tile(np.arange(people), instants)
    states = (part.reshape(-1, 2) for part in (position, velocity, goal))
    trajectories = Trajectories(time_s, track, *states, desired_speed_mps=np.ones(instants * people))
    return Scene("walked", trajectories, EMPTY_ROOM.occupancy(), dt_s)


def line(start, step, count):
    return np.array(start) + np.arange(count)[:, None] * np.array(step)


def test_a_steady_walker_reaches_targets_in_time():
    there = [[3.5, 4.0]] * 5 + [[9.5, 4.0]] * 20 + [[2.0, 4.0]] * 5
    found = count_walking([walked([line((2.0, 4.0), (0.3, 0.0), 30)], [there])], SETTINGS)
    assert (found.states, found.in_obstacle, found.above_cap, found.slow, found.close) == (30, 0, 0, 0, 0)
    assert (found.targets, found.reached) == (1, 1)  # the first began before, the last is not over yet
    assert found.speed_sum == pytest.approx(30.0)


def test_a_target_reached_too_late_counts():
    goals = [[3.0, 4.0]] + [[4.0, 4.0]] * 40 + [[3.0, 4.0]]
    found = count_walking([walked([line((3.0, 4.0), (0.02, 0.0), 42)], [goals])], SETTINGS)  # 1 m in 12 s
    assert (found.targets, found.reached) == (1, 0)


def test_standing_behind_somebody_is_a_queue():
    goals = [[[11.0, 4.0]] * 8] * 2
    front, behind = line((5.0, 4.0), (0.0, 0.0), 8), line((4.4, 4.0), (0.0, 0.0), 8)
    found = count_walking([walked([front, behind], goals)], SETTINGS)
    assert (found.slow, found.slow_outside_queues, found.close) == (16, 8, 0)


def test_walls_caps_and_closeness_are_counted():
    runner, walker = line((2.0, 0.1), (0.9, 0.0), 5), line((2.0, -0.1), (0.9, 0.0), 5)
    found = count_walking([walked([runner, walker], [[[11.0, 4.0]] * 5] * 2)], SETTINGS)
    assert (found.in_obstacle, found.above_cap, found.close) == (5, 10, 10)


def test_separate_lanes_are_perfect_order():
    forward = np.array([True, True, False, False])
    assert lane_order(np.array([1.0, 1.1, 3.0, 3.1]), forward, 0.4) == 1.0
    assert lane_order(np.array([1.0, 1.1, 1.0, 1.1]), forward, 0.4) == pytest.approx(1 / 9)
    assert np.isnan(lane_order(np.array([0.0, 2.0, 4.0, 6.0]), forward, 0.4))


def test_a_small_experiment_becomes_a_page():
    small = replace(FLOW, people=(6, 50), settle_s=6.0, seconds=3.0)
    rows, clearest = corridor_flow(small, SETTINGS)
    assert [row["people"] for row in rows] == [6, 50]
    assert 0.2 < rows[1]["density_per_m2"] < 0.8
    assert rows[1]["speed_mps"] < 1.8
    counts = WalkingCounts(10, slow=1, targets=4, reached=4)
    section = crowd_section({"main": counts.shares()}, rows, clearest)
    assert all(png_bytes(picture.figure).startswith(b"\x89PNG") for picture in section.pictures)
    page = section.markdown("simulation")
    assert "| main | no state in an obstacle | 0.00% | met |" in page
