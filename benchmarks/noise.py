"""Errors beside the noise of detections, learned or not: `python -m benchmarks.noise [FILE ...]`.

White noise is added to the detections of each recording; the truth stays. Beside the network stand constant
velocity and the Kalman filter with the same tracker, and the network's error over the better of both. Without
files: the places in data/scenes/real. The network may have been trained on them: compare rows of one place.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.timing import needed, tell
from pedpred.command.conversion import read_any
from pedpred.command.prediction import robot_for
from pedpred.evaluation import EvaluationSettings
from pedpred.metrics import METRICS
from pedpred.online import OnlinePredictor
from pedpred.online.assessment import assess
from pedpred.online.settings import OnlineSettings
from pedpred.scenes import Scene
from pedpred.simulation.sensor import SensorSettings
from pedpred.storage.scenes import scene_folders

NOISES_M = (0.0, 0.02, 0.05, 0.1)
METRIC = "ade_m"


def errors(scene: Scene, noise_m: float, learn: bool) -> dict[str, float]:
    """ADE of each method at one place, m."""
    age_s = robot_for(scene, None).settings.max_age_s
    predictor = OnlinePredictor.load(None, OnlineSettings(age_s, learn_noise=learn))
    sensor = SensorSettings(position_noise_m=noise_m)
    scores = assess(scene, predictor, EvaluationSettings(), sensor, metrics={METRIC: METRICS[METRIC]})
    return {method: float(np.nanmean(own.values[METRIC])) for method, own in scores.items()}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("recording", nargs="*", type=Path, help="any file that `pedpred evaluate` reads")
    given = parser.parse_args().recording
    places = given or scene_folders(needed(Path("data/scenes/real"), "dvc repro ingest"))
    rows = []
    for path in places:
        scene = read_any(path)
        for noise_m in NOISES_M:
            for learn in (False, True):
                found = errors(scene, noise_m, learn)
                row = {"place": scene.name, "noise, m": noise_m, "tracker": "learns" if learn else "fixed"}
                best = min(found["cv"], found["kalman_cv"])
                rows.append(row | found | {"network over best": found["network"] / best})
    tell("ADE, m", rows)


if __name__ == "__main__":
    main()
