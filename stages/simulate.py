"""Simulate the arrangements of one data set; one scene folder each."""

from __future__ import annotations

import os
from pathlib import Path

from joblib import Parallel, delayed
from omegaconf import DictConfig
from tqdm import tqdm

from pedpred.config import plain, stage, stage_key
from pedpred.simulation.arrangements import Arrangement, arrangements, simulated
from pedpred.simulation.settings import SocialForceSettings, social_force_settings
from pedpred.storage.scenes import write_scene


def simulate_into(out: Path, arrangement: Arrangement, settings: SocialForceSettings) -> None:
    """One worker's job: simulate one arrangement and write it."""
    write_scene(simulated(arrangement, settings), out / arrangement.name)


@stage
def main(cfg: DictConfig) -> None:
    """Share the arrangements among the cores ($PEDPRED_JOBS, all by default)."""
    key = stage_key(cfg)
    out = Path(cfg.get("out") or f"data/scenes/{key}")
    groups = plain(cfg)
    settings = social_force_settings(groups["social_force"])
    todo = arrangements(groups["scenes"][key], groups["layouts"], groups["clutter"], settings)
    jobs = int(os.environ.get("PEDPRED_JOBS", os.cpu_count() or 1))
    workers = Parallel(n_jobs=jobs, return_as="generator_unordered")
    done = workers(delayed(simulate_into)(out, arrangement, settings) for arrangement in todo)
    for _ in tqdm(done, total=len(todo), desc=f"simulate {key}", unit="room"):
        pass


if __name__ == "__main__":
    main()
