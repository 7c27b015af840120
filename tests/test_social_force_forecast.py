"""The social-force forecaster knows the goals: only the noise is left to be wrong about."""

import numpy as np

from pedpred.baselines.social_force import initial_state
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from tests.simulated import QUIET, SETTINGS, scene_of, short

HORIZON = 10


def paths_of(scene, track_id, time_s, position, velocity, steps=5):
    start = initial_state(scene, np.array(track_id), time_s, position, velocity, SETTINGS.routing)
    return start.paths(SETTINGS, steps, 0.3)


def forecast(scene, rows):
    r = scene.trajectories
    return paths_of(scene, r.track_id[rows], r.time_s[rows], r.position[rows], r.velocity[rows], HORIZON)


def errors(scene, people):
    """Error of the forecaster and of constant velocity on every instant with a full future. [T, N, P]"""
    r = scene.trajectories
    steps = len(r) // people - HORIZON
    position = r.position.reshape(-1, people, 2)
    truth = np.stack([position[n : n + steps] for n in range(1, HORIZON + 1)], axis=2)
    rows = np.arange(steps * people)
    paths = forecast(scene, rows).reshape(truth.shape)
    ahead = 0.3 * np.arange(1, HORIZON + 1)[:, None]
    straight = (r.position[rows, None] + r.velocity[rows, None] * ahead).reshape(truth.shape)
    return (np.linalg.norm(p - truth, axis=-1) for p in (paths, straight))


def test_a_noise_free_future_is_reproduced():
    scene = scene_of(short(24.0, pedestrians=12)[0], QUIET)
    oracle, straight = errors(scene, 12)
    assert oracle.mean() < 1e-3
    assert oracle.max() < 0.1
    assert straight.mean() > 0.3


def pavement(velocity):
    """Two real-world tracks without known goals; the second leaves the map and ends there."""
    time_s = np.repeat(0.4 * np.arange(10), 2)
    start = np.tile([[1.0, 2.0], [4.0, 3.0]], (10, 1))
    position = start + np.tile(velocity, (10, 1)) * time_s[:, None]
    occupied = np.zeros((60, 60), dtype=bool)
    occupied[:, :3] = True
    trajectories = Trajectories(time_s, np.tile([4, 9], 10), position)
    return Scene("pavement", trajectories, OccupancyMap(occupied, np.zeros(2), 0.1), 0.4)


def test_a_goal_inside_an_obstacle_is_approached():
    scene = pavement(np.array([[0.0, -0.5], [1.0, 0.0]]))  # ends at y = 0.2 m, inside the wall
    assert scene.occupancy.is_occupied(scene.trajectories.position[-2])
    paths = paths_of(scene, [4], [0.0], [[1.0, 2.0]], [[0.0, -1.0]], HORIZON)
    assert np.isfinite(paths).all()
    assert not scene.occupancy.is_occupied(paths).any()
    assert 0.3 < paths[0, :, 1].min() < 1.5
