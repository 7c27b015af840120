"""What the comparison of the literature consists of: recordings, scenes and folds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from pedpred.errors import ValueRuleError
from pedpred.fields import LARGEST_SEED, check_choice, check_ranges, parsed, parsed_each


@dataclass(frozen=True, kw_only=True)
class WindowSettings:
    """The windows of the protocol.

    Attributes:
        observed_steps: annotations that are seen.
        predicted_steps: annotations that are forecast.
        step_s: time between two of them.
    """

    observed_steps: int
    predicted_steps: int
    step_s: float

    def __post_init__(self) -> None:
        check_ranges(self, {"observed_steps": "[2, 10000]", "predicted_steps": "[1, 10000]"})
        check_ranges(self, {"step_s": "(0, 60]"})


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
class ComparisonSettings:
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

    protocol: WindowSettings = field(metadata={"parse": partial(parsed, WindowSettings)})
    raw: str
    reader: Mapping[str, Any]
    recordings: tuple[str, ...]
    tracker: str
    samples: int
    seeds: tuple[int, ...]
    scenes: Mapping[str, Sequence[str]]
    folds: Mapping[str, LiteratureFold] = field(metadata={"parse": partial(parsed_each, LiteratureFold)})

    def __post_init__(self) -> None:
        check_ranges(self, {"samples": "[1, 1000]", "seeds": f"[0, {LARGEST_SEED}]"})
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
