"""simulate@simulation: the arrangements of one simulated set, one scene folder each."""

from __future__ import annotations

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import plain, row, stage, stage_key
from pedpred.simulation.arrangements import Arrangement, arrangements, simulated
from pedpred.simulation.settings import SocialForceSettings, social_force_settings
from pedpred.storage.scenes import write_scene
from pedpred.workers import in_parallel


def simulate_into(out: Path, arrangement: Arrangement, settings: SocialForceSettings) -> None:
    """One worker's job: simulate one arrangement and write it."""
    write_scene(simulated(arrangement, settings), out / arrangement.name)


@stage
def main(cfg: DictConfig) -> None:
    """Write data/scenes/simulated/<name>, several arrangements at once (see `pedpred.workers`)."""
    key = stage_key(cfg)
    out = Path(cfg.get("out") or f"data/scenes/simulated/{key}")
    simulation = plain(cfg.simulations[key])
    settings = social_force_settings(row(cfg, "social_forces", simulation["social_force"]))
    todo = arrangements(simulation, plain(cfg.layouts), plain(cfg.clutter), settings)
    tasks = [(out, arrangement, settings) for arrangement in todo]
    in_parallel(simulate_into, tasks, f"simulate {key}", "room")


if __name__ == "__main__":
    main()
