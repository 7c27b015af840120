"""Forecasts of a robot that meets a recorded scene frame by frame, beside those of the pipeline.

Both come from the trained networks of the same phase; the pipeline's are float32 in data/forecasts. The
sequences are replayed on as many clocks as their features have, simulated rooms with their true velocities.
Inputs are equal bit by bit; torch and onnxruntime differ in the last digits of a float.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.replay import predictions_at, replayed
from pedpred.storage.scenes import read_scene
from pedpred.storage.shards import read_manifest
from pedpred.storage.windows import read_windows

SCENES = {
    "eth": ("real", "eth", "finetune_hotel"),
    "hotel": ("real", "hotel", "finetune_eth"),
    "sim_test/office": ("sim", "office", "main"),
}
"""Scene folder: forecasts, their name and the phase whose network made them (conf/evaluation)."""


def differences(models: Path) -> Iterator[dict[str, Any]]:
    """How far apart the two forecasts of any window are at most, scene by scene.

    Args:
        models: model folders, by phase.
    """
    for place, (kind, name, phase) in SCENES.items():
        scene = read_scene(Path("data/scenes", place))
        windows = read_windows(Path("data/forecasts", kind, f"{name}.parquet"))
        features, _ = read_manifest(Path("data/features", place.split("/")[0]))
        settings = OnlineSettings.as_offline(features, scene.detection_dt_s)
        robot = OnlinePredictor.load(models / phase, settings)
        frames = len(np.unique(scene.trajectories.time_s))
        forecasts = tqdm(replayed(scene, robot, kind == "sim"), total=frames, desc=place, unit="frame")
        offline = windows.predictions["lstm"].point
        sizes = offline.shape[1], windows.dt_s
        online = predictions_at(forecasts, windows.track_id, windows.time_s, *sizes).point
        apart = np.linalg.norm(online - offline, axis=-1).max(axis=1)
        yield {
            "scene": place,
            "network": phase,
            "phase_offsets": features.phase_offsets,
            "windows": len(windows),
            "median_m": float(np.median(apart)),
            "largest_m": float(apart.max()),
            "above_1e-4_m": int((apart > 1e-4).sum()),
        }
