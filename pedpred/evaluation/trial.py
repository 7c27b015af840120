"""One method in the scenes of a test set, with forecasts and scores as files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.evaluation.forecasts import EvaluationWindows, write_windows
from pedpred.evaluation.measure import given, measure
from pedpred.evaluation.scores import MetricSettings, write_scores
from pedpred.evaluation.windows import WindowSet, find_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception, fitted
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.models.lstm.features import LstmFeatures
from pedpred.scenes import Predictions
from pedpred.simulation.settings import SocialForceSettings
from pedpred.storage.scenes import read_scene


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
        memory: the forecaster reads the steps of a clock, see `find_windows`.
        fits: the tracker is fitted to each scene itself, see `pedpred.features.perception.fitted`.
        shown: grids that the forecaster reads, for pictures; None: it reads none.
    """

    method: str
    forecaster: Forecaster
    how: Perception
    protocol: ForecastProtocol
    social_force: SocialForceSettings | None
    settings: MetricSettings
    memory: bool = False
    fits: bool = False
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
    how = fitted(scene, trial.how, trial.protocol) if trial.fits else trial.how
    windows = find_windows(scene, how, trial.protocol, trial.social_force, trial.memory)
    predictions = trial.forecaster(windows.request)
    measured = measure(windows, {trial.method: given(predictions)}, trial.settings)
    shown = forecast_windows(windows, {trial.method: predictions}, trial.shown)
    write_windows(shown, forecasts / f"{scene.name}.parquet")
    write_scores(measured[trial.method], scores / f"{scene.name}.parquet")


def forecast_windows(
    windows: WindowSet, predictions: Mapping[str, Predictions], shown: LstmFeatures | None = None
) -> EvaluationWindows:
    """Arrange windows with their forecasts, as they are written.

    Args:
        windows: of a scene.
        predictions: of each method, world frame. {method: [W]}
        shown: sizes of the grids that pictures of the windows show; None: none.
    """
    asked = windows.request.asked
    return EvaluationWindows(
        asked.track_id,
        asked.time_s,
        asked.position,
        asked.heading_rad,
        asked.velocity,
        truth=windows.truth,
        predictions=dict(predictions),
        dt_s=windows.request.sizes.dt_s,
        **_grids(windows.request, shown),
    )


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
