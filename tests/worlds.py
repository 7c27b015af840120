"""Small worlds that tests share."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from pedpred.features import extract_blocks
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.sources import SOURCES
from pedpred.sources.eth_ucy import read_text
from pedpred.tracking import KalmanSettings, follow
from tests.conftest import ROOT, raw_folder

PLACES = yaml.safe_load((ROOT / "conf/places/recorded.yaml").read_text())
EXCERPT = "excerpt"
"""Half a minute of zara01, which is part of the project (examples/zara01)."""


def recorded(place):
    """A real scene, as configured; the test skips where its recording is nowhere, but for `EXCERPT`."""
    if place == EXCERPT:
        return read_text(ROOT / "examples/zara01", place, PLACES["zara01"]["settings"] | {"recording": place})
    row = PLACES[place]
    _, _, data_set, *inside = Path(row["folder"]).parts
    return SOURCES[row["source"]](raw_folder(data_set).joinpath(*inside), place, row["settings"])


def extract(*arguments, **given):
    """All blocks of a scene as one table."""
    (table,) = extract_blocks(*arguments, **given, rows=10**9)
    return table


def empty_map(size_m=20.0, resolution_m=0.1):
    cells = round(size_m / resolution_m)
    return OccupancyMap(np.zeros((cells, cells), bool), np.array([-size_m / 2, -size_m / 2]), resolution_m)


def blocked(where):
    """The empty map with obstacles at some cells."""
    room = empty_map()
    occupied = room.occupied.copy()
    occupied[where] = True
    return replace(room, occupied=occupied)


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


def jittered(scene, most_s, rng, of_each="frame"):
    """The scene with its time stamps off by up to `most_s`: those of whole frames, or of every detection."""
    trajectories = scene.trajectories
    _, frame = np.unique(trajectories.time_s, return_inverse=True)
    group = frame if of_each == "frame" else np.arange(len(trajectories))
    time_s = trajectories.time_s + rng.uniform(-most_s, most_s, len(trajectories))[group]
    return replace(scene, trajectories=replace(trajectories, time_s=time_s))


def tracked(scene, kalman=KalmanSettings(0.1, 0.1)):  # noqa: B008
    return follow(scene.trajectories, "kalman", kalman, 0.2)


def walled_scene(rng, dt_s=0.4, truth=False, **options):
    """Random walks in a room with random blocks."""
    room = empty_map()
    occupied = room.occupied.copy()
    for _ in range(12):
        x, y = rng.integers(0, 180, 2)
        occupied[x : x + 12, y : y + 5] = True
    trajectories = wandering(rng, dt_s=dt_s, truth=truth, **options)
    return Scene("walled", trajectories, OccupancyMap(occupied, room.origin, room.resolution_m), dt_s)


def come_again(scene, after_s):
    """A scene in which everybody comes again some time later, as somebody else."""
    people = scene.trajectories
    later = replace(people, time_s=people.time_s + after_s, track_id=people.track_id + 1000)
    both = {
        name: np.concatenate([values, getattr(later, name)])
        for name, values in vars(people).items()
        if values is not None
    }
    return replace(scene, trajectories=replace(people, **both))
