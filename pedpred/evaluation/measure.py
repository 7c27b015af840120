"""Forecasters in the same windows, measured alike."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.evaluation.scores import MetricSettings, Scores, score
from pedpred.evaluation.windows import WindowSet
from pedpred.features import FeatureTable
from pedpred.forecasting import Forecaster
from pedpred.metrics import METRICS, Metric, MetricScene
from pedpred.metrics.covering import covering_paths
from pedpred.scenes import OccupancyMap, Predictions

BEST_ADE, BEST_FDE = "best_ade_m", "best_fde_m"
"""Errors of the nearest of some samples, each with its own nearest one; NaN for a method with one path
and no covariances.

The samples are those of `covering_paths`, or all modes of a method that gives no covariances.
"""


def measure(
    windows: WindowSet,
    forecasters: Mapping[str, Forecaster],
    settings: MetricSettings,
    metrics: Mapping[str, Metric] | None = None,
    samples: int = 0,
) -> dict[str, Scores]:
    """Forecast and measure the windows of a scene.

    Args:
        windows: of the scene.
        forecasters: by method.
        settings: thresholds of the metrics.
        metrics: which ones alone; None: all, and the calibration at each step.
        samples: number of paths of which the best one counts; 0: without `BEST_ADE` and `BEST_FDE`.

    Raises:
        ValueRuleError: a window has no forecast, or one that some metrics could not measure; or forecasts are
            those of other instants or in another frame, or more or fewer than were asked for.

    Returns:
        The scores of each method.
    """
    request, truth = windows.request, windows.truth
    scene = describe_scene(request.asked, request.scene.occupancy, settings)
    chosen = METRICS if metrics is None else metrics
    scores = {}
    for method, forecast in forecasters.items():
        predictions = forecast(request)
        _check_time_step(method, predictions, request.sizes.dt_s)
        found = score(predictions, truth, windows.track, scene, chosen, steps=metrics is None)
        best = best_of(predictions, truth, samples) if samples else {}
        scores[method] = replace(
            found,
            values={**found.values, **best},
            without_truth=windows.without_truth,
            noncausal=request.sizes.noncausal,
        )
    return scores


def describe_scene(asked: FeatureTable, occupancy: OccupancyMap, settings: MetricSettings) -> MetricScene:
    """Collect what metrics know of a scene besides predictions and truth.

    Args:
        asked: the evaluation windows. [W]
        occupancy: static obstacles.
        settings: thresholds.
    """
    return MetricScene(
        occupancy,
        asked.time_s,
        np.hypot(*asked.velocity.T),
        settings.moving_mps,
        settings.collision_m,
        settings.miss_m,
    )


def best_of(predictions: Predictions, truth: np.ndarray, samples: int) -> dict[str, np.ndarray]:
    """Errors `BEST_ADE` and `BEST_FDE`, m. [W] each.

    Args:
        predictions: world frame. [W]
        truth: world frame, m. [W, P, 2]
        samples: number of paths.
    """
    spread = predictions.covariance is not None
    if not spread and predictions.modes == 1:
        return dict.fromkeys((BEST_ADE, BEST_FDE), np.full(len(truth), np.nan))
    paths = covering_paths(predictions, samples) if spread else predictions.path[:, :samples]
    away_m = np.linalg.norm(paths - truth[:, None], axis=-1)
    return {BEST_ADE: away_m.mean(axis=2).min(axis=1), BEST_FDE: away_m[..., -1].min(axis=1)}


def given(predictions: Predictions) -> Forecaster:
    """A forecaster that answers with forecasts which were already made for the windows."""
    return lambda request: predictions


def _check_time_step(method: str, predictions: Predictions, dt_s: float) -> None:
    if not np.isclose(predictions.dt_s, dt_s):
        rule = f"it must be {dt_s}, the time step that the request asks for"
        raise ValueRuleError(f"{method}.dt_s", predictions.dt_s, rule)
