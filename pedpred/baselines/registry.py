"""All forecasters that need no training, by name."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from pedpred.baselines.candidates import Candidates, drawn_anew, own_pool
from pedpred.baselines.goal_blind import goal_blind_paths
from pedpred.baselines.kinematic import KINEMATIC
from pedpred.baselines.social_force import initial_state_of
from pedpred.errors import ConfigError
from pedpred.features import FeatureTable
from pedpred.scenes import Scene
from pedpred.simulation.settings import social_force_settings


class ForecastRequest(NamedTuple):
    """What a baseline is asked to forecast, and all that it may look at.

    Attributes:
        scene: recording and obstacles.
        table: the scene's whole feature table.
        rows: of everybody at some instants. [R]
        ahead_s: times to forecast, equally spaced, s. [P]
        social_force: configuration group of that name.
        imagined_goals: how many to draw where a forecaster is not told the room's own.
    """

    scene: Scene
    table: FeatureTable
    rows: np.ndarray
    ahead_s: np.ndarray
    social_force: Mapping[str, Any]
    imagined_goals: int


Baseline = Callable[[ForecastRequest], np.ndarray]
"""-> paths [R, P, 2], world, m"""


def _social_force(asked: ForecastRequest) -> np.ndarray:
    model = social_force_settings(asked.social_force)
    initial_state = initial_state_of(asked.scene, asked.table.select(asked.rows), model.routing)
    return initial_state.paths(model, len(asked.ahead_s), float(asked.ahead_s[0]))


def _goal_blind(asked: ForecastRequest) -> np.ndarray:
    return _inferring(asked, own_pool(asked.scene), _chance(asked))


def _goal_unseen(asked: ForecastRequest) -> np.ndarray:
    rng, crowd = _chance(asked), social_force_settings(asked.social_force).crowd
    drawn = drawn_anew(asked.scene.occupancy, crowd.clearance_m, asked.imagined_goals, rng)
    return _inferring(asked, drawn, rng)


def _inferring(asked: ForecastRequest, candidates: Candidates, rng: np.random.Generator) -> np.ndarray:
    steps, dt_s = len(asked.ahead_s), float(asked.ahead_s[0])
    occupancy, settings = asked.scene.occupancy, asked.social_force
    return goal_blind_paths(occupancy, asked.table, asked.rows, candidates, settings, steps, dt_s, rng)


def _chance(asked: ForecastRequest) -> np.random.Generator:
    return np.random.default_rng(zlib.crc32(asked.scene.name.encode()))


def _from_present_motion(forecast: Callable[[FeatureTable, np.ndarray], np.ndarray]) -> Baseline:
    return lambda asked: forecast(asked.table.select(asked.rows), asked.ahead_s)


BASELINES: dict[str, Baseline] = {
    **{name: _from_present_motion(forecast) for name, forecast in KINEMATIC.items()},
    "social_force": _social_force,
    "goal_blind": _goal_blind,
    "goal_unseen": _goal_unseen,
}


def baseline(name: str) -> Baseline:
    """Look a baseline up.

    Raises:
        ConfigError: there is none of that name.
    """
    if name not in BASELINES:
        raise ConfigError("evaluation.baselines", name, f"known baselines are {sorted(BASELINES)}")
    return BASELINES[name]
