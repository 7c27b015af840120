"""One scene, all forecasters, the same windows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pedpred.evaluation.scores import Scores, metric_scene, score, true_paths, windows_of
from pedpred.evaluation.settings import EvaluationSettings
from pedpred.features import FeatureTable
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.scenes import Predictions
from pedpred.storage.windows import EvaluationWindows


def compare(
    request: ForecastRequest, forecasters: Mapping[str, Forecaster], settings: EvaluationSettings
) -> tuple[EvaluationWindows, dict[str, Scores]]:
    """Forecast and measure all evaluation windows of a scene.

    Args:
        request: about the scene; its rows are replaced.
        forecasters: by method.
        settings: thresholds of the metrics.

    Raises:
        ValueRuleError: the scene has no window.

    Returns:
        Windows with all predictions, and the scores of each method.
    """
    rows = windows_of(request.table, request.sizes, request.scene.name)
    asked = replace(request, rows=rows)
    predictions = {method: forecast(asked) for method, forecast in forecasters.items()}
    windows, truth = asked.asked, true_paths(asked.asked, asked.sizes.dt_s)
    scene = metric_scene(windows, request.scene.occupancy, settings)
    scores = {m: score(own, truth, windows.track_id, scene) for m, own in predictions.items()}
    return evaluation_windows(asked, windows, truth, predictions), scores


def evaluation_windows(
    request: ForecastRequest,
    windows: FeatureTable,
    truth: np.ndarray,
    predictions: Mapping[str, Predictions],
) -> EvaluationWindows:
    """Collect what pictures need.

    Args:
        request: that the predictions answer.
        windows: the features of its rows. [W]
        truth: world frame, m. [W, P, 2]
        predictions: by method, world frame. [W]
    """
    return EvaluationWindows(
        track_id=windows.track_id,
        time_s=windows.time_s,
        position=windows.position,
        heading_rad=windows.heading_rad,
        velocity=windows.velocity,
        packed_grid=windows.occupancy,
        angular_grid_m=windows.angular_grid,
        truth=truth,
        predictions=dict(predictions),
        dt_s=request.sizes.dt_s,
        grid_cells=request.sizes.grid_cells,
        grid_resolution_m=request.sizes.grid_resolution_m,
        max_range_m=request.sizes.max_range_m,
    )
