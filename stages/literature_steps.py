"""literature_steps: what a network with a memory reads along the recordings of ETH and UCY, step by step."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import stage
from pedpred.features import extract_blocks
from pedpred.literature.windows import protocol_of
from pedpred.models.features import RowFormat
from pedpred.storage.scenes import read_scene
from pedpred.storage.shards import write_manifest, write_shard
from pedpred.tracking import KalmanBank, follow
from pedpred.workers import in_parallel
from stages.features import features_of, kalman_of
from stages.literature_windows import RECORDINGS, protocol_settings

_MODEL = "lstm"
"""Whose inputs these are."""


def steps_into(out: Path, cfg: DictConfig, name: str) -> None:
    """Write the shard of one recording, none where it is not available. A job of one worker."""
    made_with = RowFormat(protocol_of(protocol_settings(cfg)), _MODEL, features_of(cfg, _MODEL))
    scene, protocol = read_scene(RECORDINGS / name), made_with.protocol
    available = scene.unavailable is None
    if available:
        tracker, still_mps = kalman_of(cfg, cfg.literature.tracker), cfg.protocol.standstill_mps
        bank = KalmanBank.around(tracker)
        tracks = follow(scene.trajectories, "kalman", bank, still_mps, protocol.lost_after_s)
        write_shard(extract_blocks(scene, tracks, protocol, made_with.features), out, name)
    write_manifest(out, made_with, {name: RECORDINGS / name} if available else {})


@stage
def main(cfg: DictConfig) -> None:
    """Write data/far/steps/recordings/<recording>; no rows where the recordings are not available."""
    out = Path(cfg.get("out", "data/far/steps/recordings"))
    tasks = [(out / name, cfg, name) for name in cfg.literature.recordings]
    in_parallel(steps_into, tasks, "steps of the literature", "recording")


if __name__ == "__main__":
    main()
