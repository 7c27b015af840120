"""One scene, all forecasters, the same windows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pedpred.baselines.registry import baseline
from pedpred.evaluation.scores import Scores, pooled, score, true_paths, world_paths
from pedpred.evaluation.summary import summary
from pedpred.features import FeatureSettings, FeatureTable
from pedpred.models.forecasting import forecast_velocities
from pedpred.models.motion import MotionLstm
from pedpred.scenes import Scene

REFERENCE = "kalman_cv"
"""The strongest simple method, which every other is compared with window by window."""

_SAME_INSTANT_S = 1e-4


def compare(
    scene: Scene,
    table: FeatureTable,
    codes: np.ndarray,
    settings: FeatureSettings,
    networks: Mapping[str, MotionLstm],
    baselines: Sequence[str],
    options: Mapping[str, Any],
    social_force: Mapping[str, Any],
) -> tuple[dict[str, np.ndarray], dict[str, Scores]]:
    """Forecast and measure.

    Args:
        scene: the test scene.
        table: its features, all rows.
        codes: the frozen encoder's outputs of all rows. [M, C]
        settings: sizes of the features.
        networks: trained networks by method name.
        baselines: names of the untrained methods.
        options: `evaluation` configuration: moving_mps, collision_m.
        social_force: settings of the social-force model at this place.

    Returns:
        Columns of the forecast file (one row per window), and the scores of each method.
    """
    ahead_s = (np.arange(settings.horizon_steps) + 1) * settings.dt_s
    window = np.flatnonzero(table.window)
    windows = table.select(window)
    paths = {}
    together = seen_together(table)
    for name in baselines:
        everybody = baseline(name)(scene, table, together, ahead_s, social_force)
        paths[name] = everybody[np.searchsorted(together, window)]
    for name, network in networks.items():
        velocities = forecast_velocities(network, table, codes, settings)
        paths[name] = world_paths(windows, velocities[window], settings.dt_s)
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


def figures(
    test: str, scores: Mapping[str, Mapping[str, Scores]], samples: int, seed: int, leaks: bool
) -> dict[str, dict[str, Any]]:
    """Metric entries of a test set: all its scenes pooled, and each one when there are several.

    Args:
        test: name of the test set.
        scores: scene name -> method -> scores.
        samples: bootstrap replicates.
        seed: of the bootstrap.
        leaks: the inputs knew the future; every entry says so.
    """
    methods = next(iter(scores.values()))
    pools = {test: {m: pooled([s[m] for s in scores.values()]) for m in methods}}
    if len(scores) > 1:
        pools |= {f"{test}_{name}": dict(own) for name, own in scores.items()}
    mark = {"leaks": True} if leaks else {}
    return {
        entry: {m: mark | summary(s, pool[REFERENCE], samples, seed) for m, s in pool.items()}
        for entry, pool in pools.items()
    }
