"""What the stages of the comparison on ETH and UCY share: recordings, windows and settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

from omegaconf import DictConfig

from pedpred.config import configured, part
from pedpred.errors import ValueRuleError
from pedpred.evaluation import WindowSet
from pedpred.evaluation.observed import WindowSettings, find_observed_windows
from pedpred.features.perception import Perception
from pedpred.settings import LARGEST_SEED, In, Settings, check_choice, load
from pedpred.storage.scenes import read_scene
from pedpred.tracking import KalmanBank
from stages.perception import kalman_of

TOP, MODELS = Path("data/eth_ucy"), Path("models/eth_ucy")
RECORDINGS = TOP / "recordings"


@dataclass(frozen=True, kw_only=True)
class LiteratureFold:
    """A row of `literature.folds`.

    Attributes:
        test: scenes.
        train: recordings, none of which belongs to these scenes.
    """

    test: tuple[str, ...]
    train: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class ComparisonSettings(Settings):
    """What is compared.

    Attributes:
        protocol: of the windows.
        raw: folder of the recordings.
        reader: settings of `pedpred.sources.eth_ucy`, without the name of the file.
        recordings: names of the files.
        tracker: row of conf/trackers for the observed positions.
        samples: number of paths of which the best one counts.
        seeds: of the trainings of each fold.
        scenes: scene -> its recordings.
        folds: who is trained on what and tested where.
    """

    protocol: WindowSettings
    raw: str
    reader: Mapping[str, Any]
    recordings: tuple[str, ...]
    tracker: str
    samples: Annotated[int, In("[1, 1000]")]
    seeds: Annotated[tuple[int, ...], In(f"[0, {LARGEST_SEED}]")]
    scenes: Mapping[str, Sequence[str]]
    folds: Mapping[str, LiteratureFold]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.seeds:
            raise ValueRuleError("seeds", list(self.seeds), "there must be one at least")
        for scene, recordings in self.scenes.items():
            for name in recordings:
                check_choice(f"scenes.{scene}", name, self.recordings)
        for key, fold in self.folds.items():
            for scene in fold.test:
                check_choice(f"folds.{key}.test", scene, self.scenes)
            for name in fold.train:
                check_choice(f"folds.{key}.train", name, self.recordings)
            tested = {name for scene in fold.test for name in self.scenes[scene]}
            if both := sorted(tested & set(fold.train)):
                raise ValueRuleError(
                    f"folds.{key}.train", both, "these recordings are tested by the same fold"
                )


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


def windows_of(
    cfg: DictConfig, recording: str, memory: bool = True, bank: KalmanBank | None = None
) -> WindowSet | None:
    """Read a recording and find its windows, see `find_observed_windows`; None where it is not available.

    Args:
        cfg: the configuration.
        recording: its name.
        memory: compute the steps of networks with a memory.
        bank: of the tracker; None: that of the configuration.
    """
    scene = read_scene(RECORDINGS / recording)
    if scene.unavailable is not None:
        return None
    bank = bank or KalmanBank.around(kalman_of(cfg, cfg.literature.tracker))
    how = Perception(bank, cfg.protocol.standstill_mps)
    return find_observed_windows(scene, how, protocol_settings(cfg), memory)
