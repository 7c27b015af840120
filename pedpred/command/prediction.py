"""`pedpred predict`: replay a scene through the online predictor and record the forecasts."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from tqdm import tqdm

from pedpred.command.conversion import read_any, refuse_overwriting
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.replay import as_windows, replayed
from pedpred.ros import write_recording
from pedpred.ros.foxglove import write_layout
from pedpred.scenes import Forecast, Scene

_METHOD = "pedpred"
_COLOUR = (0.84, 0.37, 0.0)


def predict(given: argparse.Namespace) -> None:
    """Replay a scene through the online predictor and write it with the forecasts as MCAP."""
    refuse_overwriting(given.output, given.force)
    scene = read_any(given.scene)
    predictor = robot_for(scene, given.model)
    windows = as_windows(scene, with_progress(scene, predictor), _METHOD, predictor.features)
    write_recording(scene, given.output, windows, {_METHOD: _COLOUR})
    write_layout(scene.occupancy, set(), given.output.with_suffix(".foxglove.json"))


def robot_for(scene: Scene, model: Path) -> OnlinePredictor:
    """Load a predictor that does not drop people between two detections of this scene."""
    return OnlinePredictor.load(model, OnlineSettings(max_age_s=max(0.5, 1.25 * scene.detection_dt_s)))


def with_progress(scene: Scene, predictor: OnlinePredictor) -> Iterator[Forecast]:
    """Yield the forecasts of a replay, with a progress bar."""
    frames = len(np.unique(scene.trajectories.time_s))
    yield from tqdm(replayed(scene, predictor), total=frames, desc=f"replay {scene.name}", unit="frame")
