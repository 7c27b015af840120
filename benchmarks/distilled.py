"""What the distilled export loses: its errors beside those of the full one, in the same windows.

`python -m benchmarks.distilled [--model models/online/simulation] [--rooms 3]`. Both folders meet the same
simulated rooms frame by frame: first such as the main training keeps for validation, then test rooms. The
interval is that of the paired difference, bootstrapped over tracks.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks.timing import keep, needed, tell
from pedpred.config import read_params
from pedpred.evaluation.scores import true_paths
from pedpred.evaluation.summary import TrackBootstrap
from pedpred.evaluation.windows import window_request
from pedpred.features.perception import Perception
from pedpred.metrics.paths import displacement
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.replay import predictions_at, replayed
from pedpred.storage.scenes import read_scene
from pedpred.storage.shards import read_manifest


def validation_rooms(share: float, seed: int) -> list[str]:
    """The rooms that the main training keeps for validation; see `pedpred.datasets.split_sequences`."""
    names = list(read_manifest(Path("data/features/simulated/main"))[1])
    order = np.random.default_rng(seed).permutation(len(names))
    return [names[i] for i in order[: max(1, round(share * len(names)))]]


def errors_m(model: Path, data: str, room: str) -> tuple[np.ndarray, np.ndarray]:
    """Mean displacement of every evaluation window, m, and whose it is. [W], [W]."""
    scene = read_scene(Path("data/scenes/simulated", data, room))
    settings, _ = read_manifest(Path("data/features/simulated", data))
    windows = window_request(scene, Perception(None, standstill_mps=0.2), settings).asked
    robot = OnlinePredictor.load(model, OnlineSettings.as_offline(settings, scene.detection_dt_s))
    frames = len(np.unique(scene.trajectories.time_s))
    forecasts = tqdm(replayed(scene, robot, True), total=frames, desc=f"{model.name} in {room}", unit="frame")
    sizes = settings.horizon_steps, settings.dt_s
    paths = predictions_at(forecasts, windows.track_id, windows.time_s, *sizes).point
    return displacement(paths, true_paths(windows, settings.dt_s)).mean(axis=1), windows.track_id


def compared(full: Path, data: str, rooms: list[str]) -> dict[str, Any]:
    """Errors of the full and of the distilled folder over some rooms."""
    distilled = full.with_name(f"{full.name}_distilled")
    before, after, track = [], [], []
    for index, room in enumerate(rooms):
        error, own = errors_m(full, data, room)
        before.append(error)
        after.append(errors_m(distilled, data, room)[0])
        track.append(own + index * (1 << 32))
    difference = np.concatenate(after) - np.concatenate(before)
    tracks = TrackBootstrap.draw(np.concatenate(track), 1000, np.random.default_rng(0))
    low, high = tracks.interval(difference)
    return {
        "rooms": f"{data}: {', '.join(rooms)}",
        "windows": len(difference),
        "full_ade_m": float(np.concatenate(before).mean()),
        "lean_ade_m": float(np.concatenate(after).mean()),
        "lean_minus_full_m": float(difference.mean()),
        "low_m": float(low),
        "high_m": float(high),
    }


def rows(model: Path, count: int) -> Iterator[dict[str, Any]]:
    """Validation rooms, then test rooms."""
    main = read_params(Path(".")).training.main
    yield compared(model, "main", validation_rooms(main.validation_share, main.seed)[:count])
    names = list(read_manifest(Path("data/features/simulated/sim_test"))[1])
    yield compared(model, "sim_test", names[:count])


def main() -> None:
    """Measure, print, and keep the figures when asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", type=Path, default=Path("models/online/simulation"))
    parser.add_argument("--rooms", type=int, default=3, help="at most so many of either kind")
    parser.add_argument("--json", type=Path, help="write the figures there")
    options = parser.parse_args()
    needed(options.model, "dvc repro export")
    needed(Path("data/features/simulated/main"), "dvc repro features_simulated@main")
    needed(Path("data/features/simulated/sim_test"), "dvc repro features_simulated@sim_test")
    table = list(rows(options.model, options.rooms))
    tell("The distilled export beside the full one, the same windows", table)
    keep({"distilled": table}, options.json)


if __name__ == "__main__":
    main()
