"""Compare online forecasts of recorded scenes with those of the pipeline.

The scenes are those of `recording.scenes` in params.yaml that the same network and tracker forecast in the
pipeline; its forecasts come from data/forecasts (float32). A scene is replayed frame by frame, simulated ones
with true velocities. The inputs are equal bit by bit; exported weights are rounded.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import needed
from pedpred.config import plain, read_params
from pedpred.evaluation.forecasts import read_windows
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.network import read_origin
from pedpred.online.replay import predictions_at, replay_with_progress
from pedpred.storage.scenes import read_scene
from pedpred.storage.shards import read_manifest


def differences(model: Path) -> Iterator[dict[str, Any]]:
    """Yield the largest distance between both forecasts of a window, per scene.

    Args:
        model: a model folder; recordings that other networks or trackers forecast are left out.
    """
    params, origin = plain(read_params(Path())), read_origin(model)
    for name, row in params["recording"]["scenes"].items():
        kind, data = Path(row["scene"]).parts[:2]
        weights = f"models/{row['networks']}"
        tracked = kind == "simulated" or params["places"][data]["tracker"] == origin["tracker"]
        if weights != origin["networks"] or not tracked:
            continue
        folder = Path("data/forecasts", row["networks"], origin["method"], kind, data)
        forecasts_of = folder / f"{name}.parquet"
        windows = read_windows(needed(forecasts_of, "make reproduce"))
        scene = read_scene(Path("data/scenes", row["scene"]))
        features, _ = read_manifest(Path("data/features", kind, data))
        settings = OnlineSettings.as_offline(features, scene.detection_dt_s)
        robot = OnlinePredictor.load(model, replace(settings, learn_trust=params["evaluation"]["trust"]))
        forecasts = replay_with_progress(scene, robot, true_velocities=kind == "simulated")
        offline = windows.predictions[origin["method"]].point
        sizes = offline.shape[1], windows.dt_s
        online = predictions_at(forecasts, windows.track_id, windows.time_s, *sizes).point
        apart = np.linalg.norm(online - offline, axis=-1).max(axis=1)
        yield {
            "scene": name,
            "networks": row["networks"],
            "windows": len(windows),
            "median_m": float(np.median(apart)),
            "largest_m": float(apart.max()),
            "above_1e-4_m": int((apart > 1e-4).sum()),
        }
