"""How good forecasts are in somebody's own recording, as a robot would have made them there."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pedpred.baselines.kinematic import KINEMATIC
from pedpred.evaluation.scores import Scores, score, true_paths, windows_of
from pedpred.features import extract_at_detections
from pedpred.online.predictor import OnlinePredictor
from pedpred.online.replay import paths_at
from pedpred.scenes import Forecast, Scene
from pedpred.tracking import follow

NETWORK = "network"
"""What the exported network is called beside the other methods."""


def assess(
    scene: Scene,
    predictor: OnlinePredictor,
    forecasts: Iterable[Forecast],
    moving_mps: float,
    collision_m: float,
) -> dict[str, Scores]:
    """Measure the network in a scene beside the forecasts that only continue the present motion.

    A window is a detection with enough earlier ones (`min_history`) whose person is seen until the end of the
    horizon; the detections themselves, joined by a spline, are the truth. All methods see the same tracker.

    Args:
        scene: detections at any rate, regular or not.
        predictor: whose tracker and window sizes all methods share.
        forecasts: of its replay of the scene.
        moving_mps: slower pedestrians count as standing, m/s.
        collision_m: forecast pedestrians nearer than this collide, m.

    Raises:
        ValueRuleError: the scene has no window.

    Returns:
        The scores of each method in the same windows.
    """
    about, features = predictor.description, predictor.features
    tracks = follow(scene.trajectories, "kalman", about.tracker, about.standstill_mps, features.lost_after_s)
    table = extract_at_detections(scene, tracks, features)
    windows = table.select(windows_of(table, features, scene.name))
    ahead_s = (np.arange(features.horizon_steps) + 1) * features.dt_s
    paths = {name: forecast(windows, ahead_s) for name, forecast in KINEMATIC.items()}
    covariances = {}
    paths[NETWORK], covariances[NETWORK] = paths_at(
        forecasts, windows.track_id, windows.time_s, features.horizon_steps
    )
    truth = true_paths(windows, features.dt_s)
    return {
        name: score(windows, truth, path, scene.occupancy, moving_mps, collision_m, covariances.get(name))
        for name, path in paths.items()
    }
