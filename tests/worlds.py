"""Small worlds that tests share."""

import numpy as np

from pedpred.scenes import OccupancyMap, Scene, Trajectories


def empty_map(size_m=20.0, resolution_m=0.1):
    cells = round(size_m / resolution_m)
    return OccupancyMap(np.zeros((cells, cells), bool), np.array([-size_m / 2, -size_m / 2]), resolution_m)


def wandering(rng, tracks=4, detections=40, dt_s=0.4, noise_m=0.05, truth=False):
    """Smooth random walks that begin and end at different times, detected with noise."""
    times, ids, positions, velocities = [], [], [], []
    for track in range(tracks):
        first = rng.integers(0, 8)
        count = detections - first - rng.integers(0, 8)
        time_s = (first + np.arange(count)) * dt_s
        heading = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.normal(0, 0.1, count))
        velocity = rng.uniform(0.5, 1.5) * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        position = rng.uniform(-3, 3, 2) + np.cumsum(velocity * dt_s, axis=0)
        times.append(time_s)
        ids.append(np.full(count, 10 + track))
        positions.append(position + rng.normal(0, noise_m, position.shape))
        velocities.append(velocity)
    velocity = np.concatenate(velocities) if truth else None
    return Trajectories(np.concatenate(times), np.concatenate(ids), np.concatenate(positions), velocity)


def walled_scene(rng, dt_s=0.4, truth=False, **options):
    """Random walks in a room with random blocks."""
    room = empty_map()
    occupied = room.occupied.copy()
    for _ in range(12):
        x, y = rng.integers(0, 180, 2)
        occupied[x : x + 12, y : y + 5] = True
    trajectories = wandering(rng, dt_s=dt_s, truth=truth, **options)
    return Scene("walled", trajectories, OccupancyMap(occupied, room.origin, room.resolution_m), dt_s)
