"""Accuracy of online forecasts in a recording, beside simple methods."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.evaluation import EvaluationSettings, Scores
from pedpred.evaluation.compare import compare
from pedpred.evaluation.windows import window_request
from pedpred.features.perception import Perception
from pedpred.forecasting import ForecastRequest
from pedpred.online.predictor import OnlinePredictor
from pedpred.online.replay import predictions_at
from pedpred.scenes import Forecast, Predictions, Scene
from pedpred.simulation.sensor import SensorSettings

NETWORK = "network"
"""Name of the exported network beside the other methods."""


def assess(
    scene: Scene,
    predictor: OnlinePredictor,
    forecasts: Iterable[Forecast],
    settings: EvaluationSettings,
    sensor: SensorSettings | None = None,
) -> dict[str, Scores]:
    """Measure the network in a scene, beside the baselines that continue the present motion.

    The windows are those of the pipeline (`windows_of`); the detections themselves, joined by a spline, are
    the truth. All methods see the same tracker.

    Args:
        scene: detections at any rate, regular or not.
        predictor: its tracker and window sizes are used for all methods.
        forecasts: of its replay of the scene, as the sensor detects it.
        settings: thresholds of the metrics.
        sensor: between the scene and the tracker; None for a perfect one.

    Raises:
        ValueRuleError: the scene has no window.

    Returns:
        The scores of each method in the same windows.
    """
    about, sizes = predictor.description, predictor.features

    def replayed_network(request: ForecastRequest) -> Predictions:
        asked = request.asked
        return predictions_at(forecasts, asked.track_id, asked.time_s, sizes.horizon_steps, sizes.dt_s)

    methods = {key: make() for key, make in PRESENT_MOTION.items()} | {NETWORK: replayed_network}
    how = Perception(about.tracker, about.standstill_mps, sensor or SensorSettings())
    request = window_request(scene, how, sizes)
    # Detections need not be regular, so that no single covariance of the tracker holds for all of them.
    _, scores = compare(replace(request, tracker=None), methods, settings)
    return scores
