"""How time grows with the number of people, as ratios in one run: `python -m benchmarks.growth`.

Writing a recording takes about as long per person whether few or many are there at an instant, and predicted
occupancy takes about as long per person, too. Both are ratios of times of the same process, per person.
"""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.timing import median_ms, tell
from pedpred.errors import user_errors
from pedpred.ros import write_recording
from pedpred.scenes import OccupancyMap, Predictions, Scene, Trajectories, predicted_occupancy
from tools.arguments import no_arguments

ROWS = 3000
GROUND = OccupancyMap(np.zeros((80, 60), bool), np.array([-4.0, -3.0]), 0.1)


def recorded(people: int) -> Scene:
    """A scene with a fixed number of detections, of so many people at an instant."""
    row = np.arange(ROWS)
    position = np.stack([row % 7, row % 5], axis=-1).astype(float)
    return Scene("crowd", Trajectories(row // people * 0.1, row % people, position), GROUND, 0.1)


def forecast(people: int) -> Predictions:
    """Random paths in six modes."""
    rng = np.random.default_rng(0)
    path = rng.uniform(-4.0, 4.0, (people, 6, 10, 2))
    weight = np.full((people, 6), 1 / 6)
    covariance = np.broadcast_to(0.03 * np.eye(2), (*path.shape, 2))
    return Predictions(path[:, 0], path, weight, 0.3, covariance)


@user_errors()
def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "scene.mcap")
        writing = {n: median_ms(partial(write_recording, recorded(n), out)) / ROWS for n in (2, 100)}
    occupancy = {n: median_ms(partial(predicted_occupancy, forecast(n), GROUND)) / n for n in (1, 20)}
    rows = [
        {"work": work, "few": min(ms), "many": max(ms), "ms per person": ms[min(ms)]}
        | {"of many": ms[max(ms)], "few / many": ms[min(ms)] / ms[max(ms)]}
        for work, ms in {"recording": writing, "occupancy": occupancy}.items()
    ]
    tell("time per person, where few and where many are", rows)


if __name__ == "__main__":
    no_arguments("benchmarks.growth", __doc__)
    main()
