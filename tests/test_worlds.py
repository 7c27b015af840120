"""Simulated worlds keep the laws of walking, and their sensors have the faults that are set."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.report.simulation_page import weidmann_speed_mps
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.simulation.worlds import (
    DRAWN_KINDS,
    Area,
    simulate_world,
)
from pedpred.simulation.worlds.heads import Sway, move_to_heads
from pedpred.simulation.worlds.walking import SPEED_CAP
from tests.scenes import assert_same
from tests.simulated import WORLDS, short_worlds

OPEN = short_worlds(20.0, warm_up_s=8.0)
SETTINGS = replace(OPEN, room=replace(OPEN.room, closed_share=0.0))
SEEDS = range(4)


@pytest.fixture(scope="module")
def worlds():
    return {(kind, seed): simulate_world(kind, seed, SETTINGS) for kind in DRAWN_KINDS for seed in SEEDS}


def tracks(trajectories):
    """Rows of each track in the order of time."""
    order = np.lexsort((trajectories.time_s, trajectories.track_id))
    starts = np.flatnonzero(np.diff(trajectories.track_id[order]))
    return [trajectories.select(rows) for rows in np.split(order, starts + 1)]


# Worlds


def test_nobody_is_in_an_obstacle(worlds):
    for scene in worlds.values():
        assert not scene.occupancy.is_occupied(scene.trajectories.position).any(), scene.name


def test_nobody_is_faster_than_the_cap(worlds):
    for scene in worlds.values():
        speed = np.linalg.norm(scene.trajectories.velocity, axis=1)
        assert (speed <= SPEED_CAP * scene.trajectories.desired_speed_mps + 1e-6).all()
        for track in tracks(scene.trajectories):
            np.testing.assert_allclose(np.diff(track.time_s), scene.detection_dt_s, atol=1e-6)
            steps = np.linalg.norm(np.diff(track.position, axis=0), axis=1)
            cap = SPEED_CAP * track.desired_speed_mps[0] * scene.detection_dt_s
            assert (steps <= cap + 1e-6).all()


@pytest.mark.parametrize("kind", DRAWN_KINDS)
def test_the_same_seed_gives_the_same_world(kind, worlds):
    assert_same(simulate_world(kind, 1, SETTINGS), worlds[kind, 1])
    others = worlds[kind, 2].trajectories, replace(SETTINGS, seed=78)
    mine = worlds[kind, 1].trajectories.position
    for other in (others[0], simulate_world(kind, 1, others[1]).trajectories):
        assert mine.shape != other.position.shape or not np.array_equal(mine, other.position)


@pytest.mark.parametrize("kind", ["corridor", "bottleneck", "square"])
def test_who_leaves_before_the_end_is_at_a_goal(kind, worlds):
    left = [
        np.linalg.norm(track.position[-1] - track.goal[-1])
        for seed in SEEDS
        for track in tracks(worlds[kind, seed].trajectories)
        if track.time_s[-1] < worlds[kind, seed].trajectories.time_s.max() - 1e-6
    ]
    assert len(left) > 3
    assert max(left) < 1.0 + 0.3  # the reach, and a step until the next record


def lone(**changes):
    """The tracks of a world of lone people."""
    settings = replace(SETTINGS, lone=replace(SETTINGS.lone, people=200, **changes))
    return tracks(simulate_world("lone", 0, settings).trajectories)


def test_lone_people_who_do_not_meander_walk_straight_or_stand():
    for track in lone(straight_share=1.0):
        path = track.position[0] + track.velocity[0] * (track.time_s - track.time_s[0])[:, None]
        np.testing.assert_allclose(track.position, path, atol=1e-6)


def test_lone_people_turn_as_fast_as_their_range_says():
    """The turn rate has the deviation that is set, and a correlation that decays in `turn_s`."""
    own = {"turn_radps": (0.3, 0.3), "turn_s": (1.5, 1.5), "halting_share": 0.0, "standing_share": 0.0}
    velocity = np.stack([track.velocity for track in lone(straight_share=0.0, **own)])
    turn = np.diff(np.unwrap(np.arctan2(velocity[..., 1], velocity[..., 0])), axis=1) / 0.1
    assert turn.std() == pytest.approx(0.3, rel=0.05)
    assert (turn[:, 15:] * turn[:, :-15]).mean() / turn.var() == pytest.approx(np.exp(-1.0), abs=0.08)


def test_people_pass_openings_that_a_map_shows_closed(worlds):
    settings = replace(OPEN, room=replace(OPEN.room, closed_share=1.0, closed_m=(2.0, 2.0)))
    passed = 0
    for seed in SEEDS:
        truth, coarse = worlds["room", seed], simulate_world("room", seed, settings)
        assert coarse.occupancy.occupied[truth.occupancy.occupied].all()
        passed += coarse.occupancy.is_occupied(coarse.trajectories.position).sum()
    assert passed > 10


# Walking


FORMS = dict.fromkeys(WORLDS.corridor.forms, 0.0) | {"straight": 1.0}
PATTERNS = dict.fromkeys(WORLDS.corridor.streams.patterns, 0.0) | {"one_way": 1.0}
SIZE = {"width_m": (3.0, 3.0), "any_width_share": 0.0, "arm_m": (10.0, 10.0), "obstacle_share": 0.0}
STREAMS = replace(WORLDS.corridor.streams, patterns=PATTERNS, dense_share=1.0, stopping_share=0.0)
HALL = replace(WORLDS.corridor, forms=FORMS, streams=STREAMS, duration_s=20.0, **SIZE)
"""Straight corridors 3 m wide in which all walk one way."""


def test_dense_streams_are_about_as_fast_as_observed_ones():
    """Weidmann's speeds at the same density."""
    people = replace(WORLDS.people, paces={"usual": 1.0, "slow": 0.0, "fast": 0.0})
    settings = replace(WORLDS, corridor=HALL, people=people)
    densities, speeds = [], []
    for seed in range(24):
        walked = simulate_world("corridor", seed, settings).trajectories
        middle = walked.select(abs(walked.position[:, 0] - 14.0) < 3.0)
        _, instant, count = np.unique(middle.time_s, return_inverse=True, return_counts=True)
        densities.append(count[instant] / (6.0 * 3.0))
        speeds.append(np.linalg.norm(middle.velocity, axis=1))
    per_m2, speed_mps = np.concatenate(densities), np.concatenate(speeds)
    for low, high in ((0.3, 0.6), (0.6, 0.9), (0.9, 1.5)):
        here = (per_m2 >= low) & (per_m2 < high)
        assert here.sum() > 500
        assert 0.85 < speed_mps[here].mean() / weidmann_speed_mps(per_m2[here]).mean() < 1.1


@pytest.mark.parametrize("collision_free", [0.0, 1.0])
def test_groups_stay_together(collision_free):
    """Pairs in straight corridors, whichever model moves them."""
    alone = {"dense_share": 0.0, "stopping_share": 0.0}
    streams = replace(STREAMS, grouped_share=1.0, pair_share=1.0, **alone)
    model = replace(WORLDS.model, collision_free_share=collision_free)
    settings = replace(WORLDS, corridor=replace(HALL, streams=streams), model=model)
    apart = []
    for seed in range(4):
        walked = simulate_world("corridor", seed, settings).trajectories
        for group in np.unique(walked.group_id[walked.group_id >= 0]):
            pair = tracks(walked.select(walked.group_id == group))
            if len(pair) == 2:
                _, first, second = np.intersect1d(pair[0].time_s, pair[1].time_s, return_indices=True)
                apart.append(np.linalg.norm(pair[0].position[first] - pair[1].position[second], axis=1))
    assert len(apart) > 4
    assert np.median(np.concatenate(apart)) < 1.2
    assert np.quantile(np.concatenate(apart), 0.95) < 2.5


# Sensors


def parade(people=40, seconds=60.0):
    """People 3 m apart who walk along x at 1 m/s."""
    time_s = np.repeat(np.round(np.arange(0.0, seconds, 0.1), 9), people)
    person = np.tile(np.arange(people), len(time_s) // people)
    position = np.stack([time_s - 30.0, 3.0 * person], axis=1)
    velocity = np.tile([1.0, 0.0], (len(person), 1))
    ground = OccupancyMap(np.zeros((3, 3), bool), np.zeros(2), 0.1)
    return Scene("parade", Trajectories(time_s, person, position, velocity), ground, 0.1)


def sense(scene, rng, in_view=None, rate_hz=10.0, **faults):
    """What a sensor with its own clock detects."""
    sensor = SensorSettings(own_clock=True, rate_hz=rate_hz, **faults)
    return apply_sensor(scene, sensor, np.random.default_rng(rng), in_view)


def error(seen):
    """Detected minus true positions, m."""
    rows = seen.trajectories
    return rows.position - np.stack([rows.time_s - 30.0, 3.0 * rows.person_id], axis=1)


def test_a_perfect_sensor_sees_the_truth_at_its_rate():
    seen = sense(parade(), 1, rate_hz=2.67)
    assert np.abs(error(seen)).max() < 1e-6
    assert seen.trajectories.usual_interval_s() == pytest.approx(1 / 2.67)
    assert seen.detection_dt_s == pytest.approx(1 / 2.67)
    assert len(seen.trajectories) == pytest.approx(40 * 60 * 2.67, rel=0.02)
    np.testing.assert_array_equal(seen.trajectories.track_id, seen.trajectories.person_id)


def test_a_slow_sensor_sees_every_third_instant():
    seen = apply_sensor(parade(), SensorSettings(rate_hz=10 / 3), np.random.default_rng(1))
    times, every = (np.unique(scene.trajectories.time_s) for scene in (seen, parade()))
    np.testing.assert_array_equal(times, every[::3])
    assert seen.detection_dt_s == pytest.approx(0.3)


def test_noise_and_drop_outs_are_as_set():
    seen = sense(parade(), 2, rate_hz=5.0, position_noise_m=0.05, drop_out_share=0.1, jitter_s=0.02)
    assert error(seen).std() == pytest.approx(0.05, rel=0.05)
    assert len(seen.trajectories) == pytest.approx(0.9 * 40 * 300, rel=0.02)
    instants = np.unique(seen.trajectories.time_s)
    assert 0.15 < np.diff(instants).min() < np.diff(instants).max() < 0.25


def test_people_are_born_late_by_at_most_what_is_set():
    seen = sense(parade(), 4, late_s=2.0)
    births = np.array([track.time_s[0] for track in tracks(seen.trajectories)])
    assert births.max() < 2.2
    assert births.mean() == pytest.approx(1.05, abs=0.4)


def test_only_what_is_in_view_is_detected():
    view = Area(np.array([-5.0, 2.0]), np.array([12.0, 50.0]))
    seen = sense(parade(), 5, view.holds, position_noise_m=0.3).trajectories
    assert view.holds(seen.position).all()
    assert seen.position[:, 0].min() < -4.8
    assert set(seen.person_id) == set(range(1, 17))


def test_ids_switch_only_between_close_people_and_stay_switched():
    scene, rng = parade(20), np.random.default_rng(6)
    unswitched = sense(scene, rng, switch_share=0.5).trajectories
    np.testing.assert_array_equal(unswitched.track_id, unswitched.person_id)
    close = replace(scene, trajectories=replace(scene.trajectories, position=scene.trajectories.position / 6))
    seen = sense(close, rng, rate_hz=5.0, switch_share=0.01).trajectories
    switched = seen.track_id != seen.person_id
    assert 0.1 < switched.mean() < 0.95
    for row in np.split(np.arange(len(seen)), np.flatnonzero(np.diff(seen.time_s)) + 1):
        assert sorted(seen.track_id[row]) == sorted(seen.person_id[row])
    changes = sum((np.diff(track.person_id) != 0).sum() for track in tracks(seen))
    assert changes == pytest.approx(2 * 0.01 * 19 * 300, rel=0.4)  # 2 tracks, 19 pairs, 300 times


def test_heads_sway_beside_the_way_and_drift():
    body, rng = parade(), np.random.default_rng(7)
    sway = move_to_heads(body, Sway(amplitude_m=0.05), rng).trajectories.position - body.trajectories.position
    assert 0.02 < sway[:, 1].std() < 0.06
    assert sway[:, 0].std() == pytest.approx(0.4 * sway[:, 1].std(), rel=0.1)
    drift = move_to_heads(body, Sway(drift_m=0.02), rng).trajectories.position - body.trajectories.position
    assert drift.std() == pytest.approx(0.02, rel=0.1)
    still = replace(body.trajectories, velocity=np.zeros((len(body.trajectories), 2)))
    stands = move_to_heads(replace(body, trajectories=still), Sway(amplitude_m=0.05), rng)
    np.testing.assert_allclose(stands.trajectories.position, body.trajectories.position)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_crowd_does_not_dither(share):
    """Real crowds walk on, however slowly: over 3 s they get ahead by most of the way that they walk."""
    settings = replace(WORLDS, model=replace(WORLDS.model, dense_collision_free_share=share))
    ahead, way = [], []
    for seed in range(8):
        walked = simulate_world("bottleneck", seed, settings).trajectories
        for path in tracks(walked):
            steps = np.diff(path.position[::5], axis=0)
            if len(steps) >= 6:
                within = np.lib.stride_tricks.sliding_window_view(steps, 6, axis=0)  # 3 s
                ahead.append(np.linalg.norm(within.sum(axis=2), axis=1))
                way.append(np.linalg.norm(within, axis=1).sum(axis=1))
    ahead, way = np.concatenate(ahead), np.concatenate(way)
    slow = (way > 0.6) & (way < 1.8)  # 0.2 to 0.6 m/s
    assert slow.sum() > 1000
    assert ahead[slow].sum() > 0.7 * way[slow].sum()
