"""One scene, some forecasters, the same windows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.evaluation.forecasts import EvaluationWindows, write_windows
from pedpred.evaluation.scores import (
    MetricSettings,
    Scores,
    describe_scene,
    integrate_truth,
    score,
    write_scores,
)
from pedpred.evaluation.windows import ask_about_windows, count_without_truth, find_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.models.lstm.features import LstmFeatures
from pedpred.simulation.settings import SocialForceSettings
from pedpred.storage.scenes import read_scene


def compare(
    request: ForecastRequest,
    forecasters: Mapping[str, Forecaster],
    settings: MetricSettings,
    shown: LstmFeatures | None = None,
) -> tuple[EvaluationWindows, dict[str, Scores]]:
    """Forecast and measure all evaluation windows of a scene.

    Args:
        request: about the scene; its rows become the windows.
        forecasters: by method.
        settings: thresholds of the metrics.
        shown: sizes of the grids that pictures of the windows show; None: none.

    Raises:
        ValueRuleError: the scene has no window, or forecasts are those of other instants or another frame, or
            more, fewer or of other steps than were asked for.

    Returns:
        Windows with all predictions, and the scores of each method.
    """
    without_truth = count_without_truth(request.table, request.sizes, request.scene.name)
    asked = replace(request, rows=find_windows(request.table, request.sizes))
    predictions = {method: forecast(asked) for method, forecast in forecasters.items()}
    for method, forecasts in predictions.items():
        if not np.isclose(forecasts.dt_s, asked.sizes.dt_s):
            rule = f"it must be {asked.sizes.dt_s}, the time step that the request asks for"
            raise ValueRuleError(f"{method}.dt_s", forecasts.dt_s, rule)
    windows, truth = asked.asked, integrate_truth(asked.asked, asked.sizes.dt_s)
    scene = describe_scene(windows, request.scene.occupancy, settings)
    noncausal = request.sizes.noncausal
    scores = {
        method: replace(
            score(forecasts, truth, windows.track_id, scene), without_truth=without_truth, noncausal=noncausal
        )
        for method, forecasts in predictions.items()
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


@dataclass(frozen=True)
class Trial:
    """What the scenes of a test set are forecast with.

    Attributes:
        method: its key.
        forecaster: of the method.
        how: how people are perceived.
        protocol: time step, horizon, ages.
        social_force: the model of walking there, for joint rollouts; None for methods without.
        settings: of the metrics.
        memory: the forecaster reads the steps of a clock, see `ask_about_windows`.
        shown: grids that the forecaster reads, for pictures; None: it reads none.
    """

    method: str
    forecaster: Forecaster
    how: Perception
    protocol: ForecastProtocol
    social_force: SocialForceSettings | None
    settings: MetricSettings
    memory: bool = False
    shown: LstmFeatures | None = None


def evaluate_scene(folder: Path, trial: Trial, forecasts: Path, scores: Path) -> None:
    """Forecast all windows of a scene, write <scene>.parquet into both folders; nothing without recording.

    Args:
        folder: of the scene.
        trial: what it is forecast with.
        forecasts: folder of the windows with their forecasts.
        scores: folder of the scores.
    """
    scene = read_scene(folder)
    if scene.unavailable is not None:
        return
    request = ask_about_windows(scene, trial.how, trial.protocol, trial.social_force, trial.memory)
    forecasters = {trial.method: trial.forecaster}
    windows, measured = compare(request, forecasters, trial.settings, trial.shown)
    write_windows(windows, forecasts / f"{scene.name}.parquet")
    write_scores(measured[trial.method], scores / f"{scene.name}.parquet")
