"""One scene, all forecasters, the same windows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from pedpred.evaluation.scores import EvaluationSettings, Scores, metric_scene, score, true_paths
from pedpred.evaluation.windows import count_without_truth, windows_of
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.storage.windows import SIZES, EvaluationWindows


def compare(
    request: ForecastRequest,
    forecasters: Mapping[str, Forecaster],
    settings: EvaluationSettings,
) -> tuple[EvaluationWindows, dict[str, Scores]]:
    """Forecast and measure all evaluation windows of a scene.

    Args:
        request: about the scene; its rows become the windows.
        forecasters: by method.
        settings: thresholds of the metrics.

    Raises:
        ValueRuleError: the scene has no window.

    Returns:
        Windows with all predictions, and the scores of each method.
    """
    without_truth = count_without_truth(request.table, request.sizes, request.scene.name)
    asked = replace(request, rows=windows_of(request.table, request.sizes))
    predictions = {method: forecast(asked) for method, forecast in forecasters.items()}
    windows, truth = asked.asked, true_paths(asked.asked, asked.sizes.dt_s)
    scene = metric_scene(windows, request.scene.occupancy, settings)
    scores = {
        method: replace(score(own, truth, windows.track_id, scene), without_truth=without_truth)
        for method, own in predictions.items()
    }
    collected = EvaluationWindows(
        windows.track_id,
        windows.time_s,
        windows.position,
        windows.heading_rad,
        windows.velocity,
        packed_grid=windows.occupancy,
        angular_grid_m=windows.angular_grid,
        truth=truth,
        predictions=predictions,
        **{name: getattr(request.sizes, name) for name in SIZES},
    )
    return collected, scores
