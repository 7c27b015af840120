"""What the stages of the comparison on ETH and UCY share: recordings, windows and settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import configured, part
from pedpred.literature.settings import ComparisonSettings, WindowSettings
from pedpred.literature.windows import WindowSet, find_windows
from pedpred.settings import load
from pedpred.storage.scenes import read_scene
from pedpred.tracking import KalmanBank
from stages.perception import kalman_of

TOP, MODELS = Path("data/eth_ucy"), Path("models/eth_ucy")
RECORDINGS = TOP / "recordings"


def comparison_of(cfg: Mapping[str, Any]) -> ComparisonSettings:
    """Read what is compared; `networks` says how those are trained."""
    values, names = part(cfg, "literature"), [setting.name for setting in fields(ComparisonSettings)]
    with configured("literature"):
        settings: ComparisonSettings = load(ComparisonSettings, {k: values[k] for k in names if k in values})
    return settings


def protocol_settings(cfg: Mapping[str, Any]) -> WindowSettings:
    """Read how long windows are."""
    with configured("literature.protocol"):
        settings: WindowSettings = load(WindowSettings, part(cfg, "literature", "protocol"))
    return settings


def windows_of(cfg: DictConfig, recording: str, memory: bool = True) -> WindowSet | None:
    """Read a recording and find its windows, see `find_windows`; None where it is not available."""
    scene, tracker = read_scene(RECORDINGS / recording), kalman_of(cfg, cfg.literature.tracker)
    if scene.unavailable is not None:
        return None
    bank = KalmanBank.around(tracker)
    return find_windows(scene, protocol_settings(cfg), bank, cfg.protocol.standstill_mps, memory)
