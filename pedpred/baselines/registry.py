"""All forecasters that need no training, by name."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from pedpred.baselines.goal_blind import goal_blind_paths
from pedpred.baselines.kinematic import KINEMATIC
from pedpred.baselines.social_force import outset_of
from pedpred.errors import ConfigError
from pedpred.features import FeatureTable
from pedpred.scenes import Scene
from pedpred.simulation.settings import social_force_settings

Baseline = Callable[[Scene, FeatureTable, np.ndarray, np.ndarray, Mapping[str, Any]], np.ndarray]
"""(scene, its whole feature table, rows [R] of everybody at some instants, times ahead [P] s,
social-force settings) -> paths [R, P, 2], world, m"""


def _social_force(
    scene: Scene, table: FeatureTable, rows: np.ndarray, ahead_s: np.ndarray, settings: Mapping[str, Any]
) -> np.ndarray:
    model = social_force_settings(settings)
    return outset_of(scene, table.select(rows), model.routing).paths(model, len(ahead_s), float(ahead_s[0]))


def _goal_blind(
    scene: Scene, table: FeatureTable, rows: np.ndarray, ahead_s: np.ndarray, settings: Mapping[str, Any]
) -> np.ndarray:
    rng = np.random.default_rng(zlib.crc32(scene.name.encode()))
    return goal_blind_paths(scene, table, rows, settings, len(ahead_s), float(ahead_s[0]), rng)


def _from_present_motion(forecast: Callable[[FeatureTable, np.ndarray], np.ndarray]) -> Baseline:
    return lambda scene, table, rows, ahead_s, settings: forecast(table.select(rows), ahead_s)


BASELINES: dict[str, Baseline] = {
    **{name: _from_present_motion(forecast) for name, forecast in KINEMATIC.items()},
    "social_force": _social_force,
    "goal_blind": _goal_blind,
}


def baseline(name: str) -> Baseline:
    """Look a baseline up.

    Raises:
        ConfigError: there is none of that name.
    """
    if name not in BASELINES:
        raise ConfigError("evaluation.baselines", name, f"known baselines are {sorted(BASELINES)}")
    return BASELINES[name]
