"""literature_steps: what a network with a memory reads in the windows of ETH and UCY, step by step."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import stage
from pedpred.literature.windows import protocol_of, training_steps
from pedpred.models.features import RowFormat
from pedpred.storage.shards import write_manifest, write_shard
from pedpred.workers import in_parallel
from stages.features import features_of
from stages.literature_windows import RECORDINGS, protocol_settings, windows_of

_MODEL = "lstm"
"""Whose inputs these are."""


def steps_into(out: Path, cfg: DictConfig, name: str) -> None:
    """Write the shard of one recording, none where it is not available. A job of one worker."""
    made_with, scenes = RowFormat(protocol_of(protocol_settings(cfg)), _MODEL, features_of(cfg, _MODEL)), {}
    if windows := windows_of(cfg, name):
        write_shard(training_steps(windows, made_with.features), out / name, name)
        scenes[name] = RECORDINGS / name
    write_manifest(out / name, made_with, scenes)


@stage
def main(cfg: DictConfig) -> None:
    """Write data/far/steps/recordings/<recording>; no rows where the recordings are not available."""
    out = Path(cfg.get("out", "data/far/steps/recordings"))
    tasks = [(out, cfg, name) for name in cfg.literature.recordings]
    in_parallel(steps_into, tasks, "steps of the literature", "recording")


if __name__ == "__main__":
    main()
