"""One scene, all forecasters, the same windows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from pedpred.baselines.registry import ForecastRequest, baseline
from pedpred.evaluation.scores import (
    Scores,
    score,
    true_paths,
    windows_of,
)
from pedpred.features import FeatureSettings, FeatureTable
from pedpred.scenes import Predictions, Scene

_SAME_INSTANT_S = 1e-4


def compare(
    scene: Scene,
    table: FeatureTable,
    settings: FeatureSettings,
    networks: Mapping[str, Callable[[FeatureTable, FeatureSettings, np.ndarray], Predictions]],
    baselines: Sequence[str],
    options: Mapping[str, Any],
    social_force: Mapping[str, Any],
    kalman: np.ndarray | None,
) -> tuple[dict[str, np.ndarray], dict[str, Scores]]:
    """Forecast and measure.

    Args:
        scene: the test scene.
        table: its features, all rows.
        settings: sizes of the features.
        networks: give the world-frame predictions of some rows of the table, by name.
        baselines: names of the untrained methods.
        options: `evaluation` configuration: moving_mps, collision_m, imagined_goals.
        social_force: settings of the social-force model at this place.
        kalman: covariance that the tracker gives its own forecast, m^2 [P, 2, 2]; None when the tracked
            states are true.

    Raises:
        ValueRuleError: the scene has no window.

    Returns:
        Columns of the forecast file (one row per window), and the scores of each method.
    """
    ahead_s = (np.arange(settings.horizon_steps) + 1) * settings.dt_s
    window = windows_of(table, settings, scene.name)
    windows = table.select(window)
    paths, covariances = {}, {}
    together = seen_together(table)
    asked = ForecastRequest(scene, table, together, ahead_s, social_force, options["imagined_goals"])
    for name in baselines:
        everybody = baseline(name)(asked)
        paths[name] = everybody[np.searchsorted(together, window)]
    if kalman is not None:
        covariances["kalman_cv"] = np.tile(kalman, (len(window), 1, 1, 1))
    for name, predict in networks.items():
        predictions = predict(table, settings, window)
        paths[name] = predictions.point
        if predictions.covariance is not None:
            covariances[name] = predictions.covariance[:, 0]
    truth = true_paths(windows, settings.dt_s)
    near = (options["moving_mps"], options["collision_m"])
    scores = {
        name: score(windows, truth, path, scene.occupancy, *near, covariances.get(name))
        for name, path in paths.items()
    }
    return forecast_columns(windows, truth, paths, covariances), scores


def seen_together(table: FeatureTable) -> np.ndarray:
    """Rows at the instants of evaluation windows: everybody whom a joint forecast must move. [R].

    At such an instant (an annotation) each track stands in exactly one of its clocks' rows.
    """
    instant = np.round(table.time_s / _SAME_INSTANT_S).astype(np.int64)
    return np.flatnonzero(np.isin(instant, instant[table.window]))


def forecast_columns(
    windows: FeatureTable,
    truth: np.ndarray,
    paths: Mapping[str, np.ndarray],
    covariances: Mapping[str, np.ndarray],
) -> dict[str, np.ndarray]:
    """What the pictures need, one row per window; world paths, m [P, 2], and covariances, m^2 [P, 2, 2]."""
    columns = {
        "track_id": windows.track_id,
        "phase": windows.phase,
        "step": windows.step,
        "time_s": windows.time_s,
        "x_m": windows.position[:, 0],
        "y_m": windows.position[:, 1],
        "heading_rad": windows.heading_rad,
        "vx_mps": windows.velocity[:, 0],
        "vy_mps": windows.velocity[:, 1],
        "grid": windows.occupancy,
        "angular_grid": windows.angular_grid,
        "truth": truth.astype(np.float32),
    }
    columns |= {f"path_{name}": path.astype(np.float32) for name, path in paths.items()}
    return columns | {f"covariance_{name}": own.astype(np.float32) for name, own in covariances.items()}
