"""One scene, all forecasters, the same windows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pedpred.baselines.registry import baseline
from pedpred.evaluation.scores import Scores, score, true_paths, windows_of, world_paths
from pedpred.features import FeatureSettings, FeatureTable
from pedpred.scenes import Scene

_SAME_INSTANT_S = 1e-4


def compare(
    scene: Scene,
    table: FeatureTable,
    settings: FeatureSettings,
    velocities: Mapping[str, np.ndarray],
    baselines: Sequence[str],
    options: Mapping[str, Any],
    social_force: Mapping[str, Any],
) -> tuple[dict[str, np.ndarray], dict[str, Scores]]:
    """Forecast and measure.

    Args:
        scene: the test scene.
        table: its features, all rows.
        settings: sizes of the features.
        velocities: what each network forecasts at every row, agent frames, m/s. {method: [M, P, 2]}
        baselines: names of the untrained methods.
        options: `evaluation` configuration: moving_mps, collision_m.
        social_force: settings of the social-force model at this place.

    Raises:
        ValueRuleError: the scene has no window.

    Returns:
        Columns of the forecast file (one row per window), and the scores of each method.
    """
    ahead_s = (np.arange(settings.horizon_steps) + 1) * settings.dt_s
    window = windows_of(table, settings, scene.name)
    windows = table.select(window)
    paths = {}
    together = seen_together(table)
    for name in baselines:
        everybody = baseline(name)(scene, table, together, ahead_s, social_force)
        paths[name] = everybody[np.searchsorted(together, window)]
    for name, forecast in velocities.items():
        paths[name] = world_paths(windows, forecast[window], settings.dt_s)
    truth = true_paths(windows, settings.dt_s)
    scores = {
        name: score(windows, truth, path, scene.occupancy, options["moving_mps"], options["collision_m"])
        for name, path in paths.items()
    }
    return forecast_columns(windows, truth, paths), scores


def seen_together(table: FeatureTable) -> np.ndarray:
    """Rows at the instants of evaluation windows: everybody whom a joint forecast must move. [R].

    At such an instant (an annotation) each track stands in exactly one of its clocks' rows.
    """
    instant = np.round(table.time_s / _SAME_INSTANT_S).astype(np.int64)
    return np.flatnonzero(np.isin(instant, instant[table.window]))


def forecast_columns(
    windows: FeatureTable, truth: np.ndarray, paths: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """What the pictures need, one row per window; paths in world metres, [P, 2] row-major."""
    columns = {
        "track_id": windows.track_id,
        "clock": windows.clock,
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
    return columns | {f"path_{name}": path.astype(np.float32) for name, path in paths.items()}
