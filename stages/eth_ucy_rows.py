"""eth_ucy_rows@features: what networks read in the recordings of ETH and UCY, and what follows."""

from __future__ import annotations

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import one_of, stage, stage_key
from pedpred.evaluation.observed import training_rows
from pedpred.features import extract_blocks
from pedpred.models.features import RowFormat
from pedpred.storage.scenes import read_scene
from pedpred.storage.shards import write_manifest, write_shard
from pedpred.storage.situations import situation_columns, write_situations, write_situations_manifest
from pedpred.tracking import KalmanBank, follow
from pedpred.workers import in_parallel
from stages.eth_ucy import RECORDINGS, TOP, protocol_settings, windows_of
from stages.perception import features_of, kalman_of

_PARTS = 5
"""Stretches of equal time of each recording, each a file."""


def write_windows(out: Path, cfg: DictConfig, made_with: RowFormat, name: str) -> None:
    """Write an instant for each window of a recording. A job of one worker."""
    names = []
    if windows := windows_of(cfg, name, memory=False):
        for number, rows in enumerate(training_rows(windows, made_with.features, _PARTS)):
            names.append(f"{name}_{number}")
            write_situations(rows, out, names[-1], situation_columns(made_with))
    write_situations_manifest(out, made_with, names)


def write_steps(out: Path, cfg: DictConfig, made_with: RowFormat, name: str) -> None:
    """Write all steps of the tracks of a recording. A job of one worker."""
    scene, protocol = read_scene(RECORDINGS / name), made_with.protocol
    available = scene.unavailable is None
    if available:
        tracker, still_mps = kalman_of(cfg, cfg.literature.tracker), cfg.protocol.standstill_mps
        bank = KalmanBank.around(tracker)
        tracks = follow(scene.trajectories, "kalman", bank, still_mps, protocol.lost_after_s)
        write_shard(extract_blocks(scene, tracks, protocol, made_with.features), out, name)
    write_manifest(out, made_with, {name: RECORDINGS / name} if available else {})


@stage("name")
def main(cfg: DictConfig) -> None:
    """Write data/eth_ucy/rows/<name>/recorded/<recording>; no rows where a recording is not available."""
    model = stage_key(cfg)
    one_of("name", model, cfg.features)
    made_with = RowFormat(protocol_settings(cfg).protocol, model, features_of(cfg, model))
    out = Path(cfg.get("out", TOP / "rows" / model / "recorded"))
    write = write_steps if made_with.features.has_memory else write_windows
    tasks = [(out / name, cfg, made_with, name) for name in cfg.literature.recordings]
    in_parallel(write, tasks, f"rows of {model}", "recording")


if __name__ == "__main__":
    main()
