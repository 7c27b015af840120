"""Compare online forecasts of recorded scenes with those of the pipeline.

The scenes are those of `recording.scenes` in params.yaml whose fold's network is exported; the pipeline's
forecasts come from data/forecasts (float32). A scene is replayed frame by frame, simulated ones with true
velocities. The inputs are equal bit by bit; torch and onnxruntime differ in the last digits of a float.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from tqdm import tqdm

from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.replay import predictions_at, replayed
from pedpred.storage.scenes import read_scene
from pedpred.storage.shards import read_manifest
from pedpred.storage.windows import read_windows


def differences(models: Path) -> Iterator[dict[str, Any]]:
    """Yield the largest distance between both forecasts of a window, per scene.

    Args:
        models: model folders, by fold; recordings of other folds are left out.
    """
    params = yaml.safe_load(Path("params.yaml").read_text())
    network = params["online"]["network"]
    for name, row in params["recording"]["scenes"].items():
        fold, (kind, data) = Path(row["fold"]).name, Path(row["scene"]).parts[:2]
        if not (models / fold).exists():
            continue
        scene = read_scene(Path("data/scenes", row["scene"]))
        windows = read_windows(Path("data/forecasts", row["fold"], f"{name}.parquet"))
        features, _ = read_manifest(Path("data/features", kind, data))
        settings = OnlineSettings.as_offline(features, scene.detection_dt_s)
        robot = OnlinePredictor.load(models / fold, settings)
        frames = len(np.unique(scene.trajectories.time_s))
        forecasts = tqdm(replayed(scene, robot, kind == "simulated"), total=frames, desc=name, unit="frame")
        offline = windows.predictions[network].point
        sizes = offline.shape[1], windows.dt_s
        online = predictions_at(forecasts, windows.track_id, windows.time_s, *sizes).point
        apart = np.linalg.norm(online - offline, axis=-1).max(axis=1)
        yield {
            "scene": name,
            "fold": fold,
            "windows": len(windows),
            "median_m": float(np.median(apart)),
            "largest_m": float(apart.max()),
            "above_1e-4_m": int((apart > 1e-4).sum()),
        }
