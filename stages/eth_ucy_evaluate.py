"""eth_ucy_evaluate: networks and simple methods in the windows of ETH and UCY."""

from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np
import torch
from omegaconf import DictConfig

from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.config import stage
from pedpred.evaluation import measure
from pedpred.evaluation.scores import mean_scores, write_scores
from pedpred.models.forecaster import forecaster
from pedpred.scenes import Scene, Trajectories
from pedpred.storage.scenes import read_scene
from pedpred.tracking import KalmanBank, tune_kalman
from pedpred.workers import in_parallel
from stages.eth_ucy import MODELS, RECORDINGS, TOP, windows_of
from stages.evaluate import metric_settings


def fit_filter(scenes: Iterable[Scene], ahead: int) -> KalmanBank | None:
    """Fit the noise of the simple methods' filter to what a fold trains on; None if none of it is available.

    Args:
        scenes: recordings.
        ahead: annotations that are forecast.
    """
    people = [scene.trajectories for scene in scenes if scene.unavailable is None]
    if not people:
        return None
    apart = 1 + max(int(part.track_id.max()) for part in people)
    track_id = np.concatenate([part.track_id + number * apart for number, part in enumerate(people)])
    time_s, position = (np.concatenate([getattr(p, name) for p in people]) for name in ("time_s", "position"))
    return KalmanBank.around(tune_kalman(Trajectories(time_s, track_id, position), ahead))


def evaluate_recording(
    cfg: DictConfig, fold: str, scene: str, name: str, fitted: KalmanBank | None, out: Path
) -> None:
    """Measure all methods in one recording; networks are the mean of their seeds. A job of one worker."""
    torch.set_num_threads(1)
    settings, windows = metric_settings(cfg), windows_of(cfg, name)
    simple = windows if fitted is None else windows_of(cfg, name, memory=False, bank=fitted)
    if windows is None or simple is None:
        return
    measured = partial(measure, settings=settings, samples=cfg.literature.samples)
    scores = measured(simple, {key: method() for key, method in PRESENT_MOTION.items()})
    choices = {"together": settings.together, "learning": False, "trust": False}  # nothing earlier is known
    for network in cfg.literature.networks:
        folders = {s: MODELS / "recorded" / network / fold / str(s) for s in cfg.literature.seeds}
        trained = {
            f"{network}_{s}": forecaster(f, Path("models/autoencoder"), **choices) for s, f in folders.items()
        }
        seeds = measured(windows, trained)
        scores |= {network: mean_scores(list(seeds.values()))} | seeds
    for method, result in scores.items():
        write_scores(result, out / scene / method / f"{name}.parquet")


@stage()
def main(cfg: DictConfig) -> None:
    """Write data/eth_ucy/scores/<fold>/<scene>/<method>/<recording>.parquet; nothing without recordings."""
    out, tasks = Path(cfg.get("out", TOP / "scores")), []
    for key, fold in cfg.literature.folds.items():
        (out / key).mkdir(parents=True, exist_ok=True)
        trained_on = (read_scene(RECORDINGS / name) for name in fold.train)
        fitted = fit_filter(trained_on, cfg.literature.protocol.predicted_steps)
        named = [(scene, name) for scene in fold.test for name in cfg.literature.scenes[scene]]
        tasks += [(cfg, key, *one, fitted, out / key) for one in named]
    in_parallel(evaluate_recording, tasks, "literature", "recording")


if __name__ == "__main__":
    main()
