"""A toy data set: lines `frame id x y` in people.txt, on free ground."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.scenes import OccupancyMap, Scene, Trajectories


def read_people(folder: Path, name: str, settings: Mapping[str, Any]) -> Scene:
    """Read the scene; `settings` has the number of frames per second, and the time between two detections."""
    frame, track, x, y = np.loadtxt(folder / "excerpt.txt").T
    position = np.stack([x, y], axis=-1)
    people = Trajectories(frame / settings["rate_hz"], track, position)
    return Scene(name, people, OccupancyMap.free_around(position), settings["dt_s"])
