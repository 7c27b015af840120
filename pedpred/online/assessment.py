"""Accuracy of online forecasts in a recording, beside simple methods."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from tqdm import tqdm

from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.errors import ValueRuleError
from pedpred.evaluation import EvaluationSettings, Scores, score
from pedpred.evaluation.scores import metric_scene, true_paths
from pedpred.evaluation.windows import count_without_truth, window_request
from pedpred.features.perception import Perception, sensed
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.metrics import METRICS, Metric
from pedpred.online.batch import predictions_at_once
from pedpred.online.predictor import OnlinePredictor
from pedpred.online.replay import predictions_at, replayed
from pedpred.scenes import Predictions, Scene
from pedpred.simulation.sensor import SensorSettings

NETWORK = "network"
"""Name of the exported network beside the other methods."""
ALWAYS = (*PRESENT_MOTION, NETWORK)
"""The methods of every assessment."""


def assess(
    scene: Scene,
    predictor: OnlinePredictor,
    settings: EvaluationSettings,
    sensor: SensorSettings | None = None,
    others: Mapping[str, Forecaster] | None = None,
    answered: Callable[[ForecastRequest], np.ndarray] | None = None,
    metrics: Mapping[str, Metric] | None = None,
) -> dict[str, Scores]:
    """Measure the network in a scene, beside the baselines that continue the present motion.

    The windows are those of the pipeline (`windows_of`); the detections themselves, joined by a spline, are
    the truth. All methods see the same tracker.

    Args:
        scene: detections at any rate, regular or not.
        predictor: its tracker and window sizes are used for all methods.
        settings: thresholds of the metrics.
        sensor: between the scene and the tracker; None for a perfect one.
        others: further methods by name; no name of `ALWAYS`.
        answered: which windows count, [W] bool; None: all.
        metrics: which ones alone; None: all, and the calibration at each step.

    Raises:
        ValueRuleError: the scene has no window, or a further method has the name of one of `ALWAYS`.

    Returns:
        The scores of each method in the same windows.
    """
    if taken := sorted(set(others or {}).intersection(ALWAYS)):
        raise ValueRuleError("others", taken, f"the names {ALWAYS} are taken")
    about, sizes, sensor = predictor.description, predictor.features, sensor or SensorSettings()
    how = Perception(about.tracker, about.standstill_mps, sensor)
    request = window_request(scene, how, sizes, memory=bool(others))
    without_truth = count_without_truth(request.table, sizes, scene.name)
    # Detections need not be regular, so that no single covariance of the tracker holds for all of them.
    request = replace(request, tracker=None)
    if answered is not None:
        request = replace(request, rows=request.rows[answered(request)])

    def network(asked: ForecastRequest) -> Predictions:
        if about.reads_situations:
            return predictions_at_once(predictor, asked, f"forecast {scene.name}")
        return _replayed(sensed(scene, sensor), predictor, asked)

    methods = {key: make() for key, make in PRESENT_MOTION.items()} | {NETWORK: network} | dict(others or {})
    windows, truth = request.asked, true_paths(request.asked, sizes.dt_s)
    known = metric_scene(windows, scene.occupancy, settings)
    return {
        name: replace(
            score(method(request), truth, windows.track_id, known, metrics or METRICS, metrics is None),
            without_truth=without_truth,
        )
        for name, method in methods.items()
    }


def _replayed(seen: Scene, predictor: OnlinePredictor, request: ForecastRequest) -> Predictions:
    """Forecasts of a network with memory, frame by frame."""
    frames = len(np.unique(seen.trajectories.time_s))
    forecasts = tqdm(replayed(seen, predictor), total=frames, desc=f"replay {seen.name}", unit="frame")
    asked, sizes = request.asked, request.sizes
    return predictions_at(forecasts, asked.track_id, asked.time_s, sizes.horizon_steps, sizes.dt_s)
