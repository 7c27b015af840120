"""What rows of simulations and places have in common, and the tables of studies beside the main pipeline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from omegaconf import DictConfig, OmegaConf

from pedpred.config import part, plain
from pedpred.settings import In, Settings


@dataclass(frozen=True)
class SetTracking(Settings):
    """What a row of simulations or places holds besides: how its scenes are seen and learned from.

    Attributes:
        social_force: row of social_forces: walking of its people, or of the forecasters that simulate them.
        tracker: row of trackers: of its people.
        sensor: row of sensors: that detects them.
        phase_offsets: step sequences per track, see `pedpred.features.extract_blocks`.
        variants: altered copies of each scene to learn from.
    """

    social_force: str
    tracker: str
    sensor: str
    phase_offsets: Annotated[int, In("[1, 100]")]
    variants: tuple[str, ...]


def tables_of(cfg: DictConfig) -> DictConfig:
    """The configuration, in which tables of its `study`, if any, stand in for those of the same names."""
    return OmegaConf.create({**plain(cfg), **part(cfg, cfg.study)}) if "study" in cfg else cfg
