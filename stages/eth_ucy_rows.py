"""eth_ucy_rows@features: what networks read in the recordings of ETH and UCY, and what follows."""

from __future__ import annotations

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import one_of, stage, stage_key
from pedpred.evaluation.observed import training_rows
from pedpred.features import extract_blocks
from pedpred.models.features import RowFormat
from pedpred.rows.files import step_columns
from pedpred.storage.scenes import read_scene
from pedpred.tracking import KalmanBank, follow
from stages.eth_ucy import RECORDINGS, TOP, protocol_settings, windows_of
from stages.perception import features_of, kalman_of
from stages.rows import Blocks, RowSet, write_sets

_PARTS = 5
"""Stretches of equal time of each recording, of which some are kept for validation."""


def window_rows(cfg: DictConfig, name: str, row_format: RowFormat) -> Blocks:
    """An instant for each window of a recording."""
    windows = windows_of(cfg, name, memory=False)
    assert windows is not None
    return training_rows(windows, row_format.features, _PARTS)


def recording_steps(cfg: DictConfig, name: str, row_format: RowFormat) -> Blocks:
    """All steps of the tracks of a recording."""
    scene, protocol = read_scene(RECORDINGS / name), row_format.protocol
    tracker, still_mps = kalman_of(cfg, cfg.literature.tracker), cfg.protocol.standstill_mps
    bank = KalmanBank.around(tracker)
    tracks = follow(scene.trajectories, "kalman", bank, still_mps, protocol.lost_after_s)
    return map(step_columns, extract_blocks(scene, tracks, protocol, row_format.features))


@stage("name")
def main(cfg: DictConfig) -> None:
    """Write data/eth_ucy/rows/<name>/recorded/<recording>; no rows where a recording is not available."""
    model = stage_key(cfg)
    one_of("name", model, cfg.features)
    row_format = RowFormat(protocol_settings(cfg).protocol, model, features_of(cfg, model))
    out = Path(cfg.get("out", TOP / "rows" / model / "recorded"))
    make = recording_steps if row_format.features.has_memory else window_rows
    sets = []
    for name in cfg.literature.recordings:
        available = read_scene(RECORDINGS / name).unavailable is None
        files = {name: (make, cfg, name, row_format)} if available else {}
        sets.append(RowSet(out / name, row_format, files, {key: key for key in files}))
    write_sets(sets, f"rows of {model}")


if __name__ == "__main__":
    main()
