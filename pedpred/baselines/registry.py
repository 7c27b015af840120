"""All forecasters that need no training, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from pedpred.baselines.kinematic import KINEMATIC
from pedpred.baselines.social_force import social_force_paths
from pedpred.errors import ConfigError
from pedpred.features import FeatureTable
from pedpred.geometry import rotate
from pedpred.scenes import Scene

Baseline = Callable[[Scene, FeatureTable, np.ndarray, Mapping[str, Any]], np.ndarray]
"""(scene, its feature table, times ahead [P] s, social-force settings) -> paths [M, P, 2], world, m"""


def _social_force(
    scene: Scene, table: FeatureTable, ahead_s: np.ndarray, settings: Mapping[str, Any]
) -> np.ndarray:
    return social_force_paths(
        scene,
        table.track_id,
        table.time_s,
        table.position,
        rotate(table.velocity, table.heading_rad),
        settings,
        len(ahead_s),
        float(ahead_s[0]),
    )


def _from_present_motion(forecast: Callable[[FeatureTable, np.ndarray], np.ndarray]) -> Baseline:
    return lambda scene, table, ahead_s, settings: forecast(table, ahead_s)


BASELINES: dict[str, Baseline] = {
    **{name: _from_present_motion(forecast) for name, forecast in KINEMATIC.items()},
    "social_force": _social_force,
}


def baseline(name: str) -> Baseline:
    """Look a baseline up.

    Raises:
        ConfigError: there is none of that name.
    """
    if name not in BASELINES:
        raise ConfigError("evaluation.baselines", name, f"known baselines are {sorted(BASELINES)}")
    return BASELINES[name]
