"""What the comparison of the literature consists of: recordings, scenes and folds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pedpred.errors import ValueRuleError
from pedpred.settings import (
    LARGEST_SEED,
    In,
    Settings,
    check_choice,
)


@dataclass(frozen=True, kw_only=True)
class WindowSettings(Settings):
    """The windows of the protocol.

    Attributes:
        observed_steps: annotations that are seen.
        predicted_steps: annotations that are forecast.
        step_s: time between two of them.
    """

    observed_steps: Annotated[int, In("[2, 10000]")]
    predicted_steps: Annotated[int, In("[1, 10000]")]
    step_s: Annotated[float, In("(0, 60]")]


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
