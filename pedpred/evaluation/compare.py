"""One scene, all forecasters, the same windows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.evaluation.scores import EvaluationSettings, Scores, metric_scene, score, true_paths
from pedpred.evaluation.windows import count_without_truth, windows_of
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.models.lstm.features import LstmFeatures


def compare(
    request: ForecastRequest,
    forecasters: Mapping[str, Forecaster],
    settings: EvaluationSettings,
    shown: LstmFeatures | None = None,
) -> tuple[EvaluationWindows, dict[str, Scores]]:
    """Forecast and measure all evaluation windows of a scene.

    Args:
        request: about the scene; its rows become the windows.
        forecasters: by method.
        settings: thresholds of the metrics.
        shown: sizes of the grids that pictures of the windows show; None: none.

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
        truth=truth,
        predictions=predictions,
        dt_s=request.sizes.dt_s,
        **_grids(asked, shown),
    )
    return collected, scores


def _grids(request: ForecastRequest, shown: LstmFeatures | None) -> dict[str, Any]:
    """Fields of `EvaluationWindows` about the grids around the people asked for; without columns for None."""
    sizes, rows = shown or LstmFeatures(), request.rows
    crops, cones = np.zeros((len(rows), 0), np.uint8), np.zeros((len(rows), 0))
    if shown is not None:
        inputs = request.inputs(shown, rows, request.table.time_s[rows])
        crops, cones = inputs["occupancy"], inputs["angular_grid"]
    return {
        "packed_grid": crops,
        "angular_grid_m": cones,
        "grid_cells": sizes.grid_cells if shown else 0,
        "grid_resolution_m": sizes.grid_resolution_m,
        "max_range_m": sizes.max_range_m,
    }
