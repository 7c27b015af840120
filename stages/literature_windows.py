"""literature_windows: what a network without memory reads in the windows of ETH and UCY, and what follows."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import configured, part, stage
from pedpred.literature.settings import WindowSettings
from pedpred.literature.windows import WindowSet, find_windows, protocol_of, training_rows
from pedpred.models.features import RowFormat
from pedpred.settings import load
from pedpred.storage.scenes import read_scene
from pedpred.storage.situations import situation_columns, write_situations, write_situations_manifest
from pedpred.tracking import KalmanBank
from pedpred.workers import in_parallel
from stages.features import features_of, kalman_of

RECORDINGS = Path("data/eth_ucy")
_MODEL = "mixture"
"""Whose inputs these are."""
_PARTS = 5
"""Stretches of equal time of each recording, each a file."""


def protocol_settings(cfg: Mapping[str, Any]) -> WindowSettings:
    """Read how long windows are."""
    with configured("literature.protocol"):
        settings: WindowSettings = load(WindowSettings, part(cfg, "literature", "protocol"))
    return settings


def windows_of(cfg: DictConfig, recording: str, memory: bool = True) -> WindowSet | None:
    """Read a recording and find its windows, see `find_windows`; None where it is not available."""
    scene, tracker = (
        read_scene(RECORDINGS / recording),
        KalmanBank.around(kalman_of(cfg, cfg.literature.tracker)),
    )
    if scene.unavailable is not None:
        return None
    return find_windows(scene, protocol_settings(cfg), tracker, cfg.protocol.standstill_mps, memory)


def windows_into(out: Path, cfg: DictConfig, name: str) -> None:
    """Write the rows of one recording. A job of one worker."""
    made_with = RowFormat(protocol_of(protocol_settings(cfg)), _MODEL, features_of(cfg, _MODEL))
    names = []
    if windows := windows_of(cfg, name, memory=False):
        for number, rows in enumerate(training_rows(windows, made_with.features, _PARTS)):
            names.append(f"{name}_{number}")
            write_situations(rows, out / name, names[-1], situation_columns(made_with))
    write_situations_manifest(out / name, made_with, names)


@stage
def main(cfg: DictConfig) -> None:
    """Write data/far/windows/<recording>; no rows where the recordings are not available."""
    out = Path(cfg.get("out", "data/far/windows"))
    tasks = [(out, cfg, name) for name in cfg.literature.recordings]
    in_parallel(windows_into, tasks, "windows of the literature", "recording")


if __name__ == "__main__":
    main()
