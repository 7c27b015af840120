"""A toy data set: lines `time id x y` in people.txt, on free ground."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.scenes import OccupancyMap, Scene, Trajectories


def read_people(folder: Path, name: str, settings: Mapping[str, Any]) -> Scene:
    """Read the scene; `settings` has the time between two detections, dt_s."""
    time_s, track, x, y = np.loadtxt(folder / "people.txt").T
    position = np.stack([x, y], axis=-1)
    people, ground = Trajectories(time_s, track, position), OccupancyMap.free_around(position)
    return Scene(name, people, ground, settings["dt_s"])
