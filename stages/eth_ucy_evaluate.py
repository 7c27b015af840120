"""eth_ucy_evaluate: networks and simple methods in the windows of ETH and UCY."""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
from omegaconf import DictConfig

from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.config import stage
from pedpred.evaluation import measure
from pedpred.evaluation.observed import find_observed_windows
from pedpred.evaluation.scores import mean_scores, write_scores
from pedpred.models.forecaster import forecaster
from pedpred.scenes import Scene, Trajectories
from pedpred.storage.scenes import read_scene
from pedpred.tracking import KalmanBank, tune_kalman
from pedpred.workers import in_parallel
from stages.evaluate import AUTOENCODER, evaluation_of
from stages.folds import trained_sets
from stages.perception import perception_of, protocol_of, windows_of
from stages.sets import tables_of

TOP = Path("data/eth_ucy")


def fit_filter(scenes: Iterable[Scene], ahead: int) -> KalmanBank | None:
    """Fit the noise of the simple methods' filter to recordings, to forecast so many annotations ahead.

    None if no recording is available.
    """
    people = [scene.trajectories for scene in scenes if scene.unavailable is None]
    if not people:
        return None
    apart = 1 + max(int(part.track_id.max()) for part in people)
    track_id = np.concatenate([part.track_id + number * apart for number, part in enumerate(people)])
    time_s, position = (np.concatenate([getattr(p, name) for p in people]) for name in ("time_s", "position"))
    return KalmanBank.around(tune_kalman(Trajectories(time_s, track_id, position), ahead))


def evaluate_recording(cfg: DictConfig, fold: str, at: str, fitted: KalmanBank | None, out: Path) -> None:
    """Measure all methods in one recording; networks are the mean of their seeds. A job of one worker."""
    torch.set_num_threads(1)
    scene, windows = read_scene(TOP / "scenes" / at), windows_of(cfg)
    settings, usual = evaluation_of(cfg)
    if scene.unavailable is not None:
        return
    assert windows is not None
    how, _ = perception_of(cfg, cfg.places[scene.name])
    seen = find_observed_windows(scene, how, windows)
    simple = seen
    if fitted is not None:
        simple = find_observed_windows(scene, replace(how, kalman=fitted), windows, memory=False)
    measured = partial(measure, settings=settings, samples=cfg.samples)
    scores = measured(simple, {key: method() for key, method in PRESENT_MOTION.items()})
    choices = {"together": usual.together, "learning": False, "trust": False, "local_errors": False}
    for network in cfg.networks:
        training = f"eth_ucy_{cfg.methods.networks[network].settings.architecture}_folds"
        folders = {
            f"{network}_{seed}": Path("models", training, network, fold, str(seed)) for seed in cfg.seeds
        }
        seeds = measured(seen, {key: forecaster(it, AUTOENCODER, **choices) for key, it in folders.items()})
        scores |= {network: mean_scores(list(seeds.values()))} | seeds
    for method, result in scores.items():
        write_scores(result, out / method / f"{scene.name}.parquet")


@stage("study")
def main(cfg: DictConfig) -> None:
    """Write data/eth_ucy/scores/<fold>/<method>/<recording>.parquet; nothing without recordings."""
    cfg = tables_of(cfg)
    out, tasks = Path(cfg.get("out", TOP / "scores")), []
    protocol, _ = protocol_of(cfg)
    for key, fold in cfg.folds.eth_ucy.items():
        (out / key).mkdir(parents=True, exist_ok=True)
        trained_on = (read_scene(TOP / "scenes" / at) for at in trained_sets(fold, cfg.places))
        fitted = fit_filter(trained_on, protocol.horizon_steps)
        tasks += [(cfg, key, at, fitted, out / key) for at in fold.test]
    in_parallel(evaluate_recording, tasks, "literature", "recording")


if __name__ == "__main__":
    main()
