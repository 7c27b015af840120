"""Laws of the simulator: people arrive, nobody enters a wall, the same seed gives the same walk."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.report.simulation_page import walking_findings
from pedpred.simulation.crowd import crowd_of
from pedpred.simulation.ground import ground_of
from pedpred.simulation.layouts import draw_targets
from pedpred.simulation.routing import routes_to
from pedpred.simulation.settings import social_force_settings
from pedpred.simulation.simulator import draw_desired_speeds, draw_visiting_plans, rollout
from pedpred.simulation.validation import count_walking
from pedpred.storage.tracks import tracks_table
from tests.refused import refused
from tests.simulated import (
    DRAWN,
    EMPTY_ROOM,
    SETTINGS,
    drawn,
    pool,
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


def test_halving_the_step_hardly_changes_a_noise_free_path():
    ground, targets, routes = ways_in("columns", seed=3)
    rng = np.random.default_rng(4)
    start = targets.position[:12]
    plan = draw_visiting_plans(targets, 12, 3, 8.0, rng)
    crowd = crowd_of(start, np.zeros((12, 2)), draw_desired_speeds(12, SETTINGS.crowd, rng), plan)
    fine = social_force_settings(with_field("clock.step_s", 0.025))
    coarse_path, fine_path = (rollout(crowd, ground, routes, s, 10, 0.3) for s in (SETTINGS, fine))
    assert np.linalg.norm(coarse_path - fine_path, axis=-1).max() < 0.1


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
