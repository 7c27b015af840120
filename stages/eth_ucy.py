"""What the stages of the comparison on ETH and UCY share: recordings, windows, folds and trainings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import configured, one_of, part
from pedpred.literature.settings import ComparisonSettings, WindowSettings
from pedpred.literature.windows import WindowSet, find_windows
from pedpred.settings import load, load_together
from pedpred.storage.scenes import read_scene
from pedpred.tracking import KalmanBank
from pedpred.training import FitSettings, InstantSettings, SequenceSettings
from pedpred.training.sets import RealShare
from stages.perception import kalman_of

TOP, MODELS = Path("data/eth_ucy"), Path("models/eth_ucy")
RECORDINGS = TOP / "recordings"
PHASES = ("worlds", "recorded")
"""Of a training: in simulation, then on the recordings of a fold."""
Phase = tuple[FitSettings, RealShare | None]
"""How a network is trained; and, if it learns from instants beside simulated ones, how much is recorded."""


def comparison_of(cfg: Mapping[str, Any]) -> ComparisonSettings:
    """Read what is compared; `networks` says how those are trained."""
    values, names = part(cfg, "literature"), [setting.name for setting in fields(ComparisonSettings)]
    with configured("literature"):
        settings: ComparisonSettings = load(ComparisonSettings, {k: values[k] for k in names if k in values})
    return settings


def phase_of(cfg: Mapping[str, Any], name: str, phase: str) -> Phase:
    """Read how a network is trained in a phase."""
    one_of("name", name, cfg["literature"]["networks"])
    options = part(cfg, "literature", "networks", name, phase)
    with configured(f"literature.networks.{name}.{phase}"):
        if "shares" not in options:
            return load(SequenceSettings, options), None
        kinds = [InstantSettings, *([RealShare] if "real_share" in options else [])]
        settings, *share = load_together(kinds, options)
    return settings, share[0] if share else None


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
