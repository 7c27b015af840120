"""Rows of the configuration: where places come from, and what is tested, exported, promised and shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pedpred.report.animation import Animation
from pedpred.settings import LARGEST_SEED, In, Settings


@dataclass(frozen=True)
class PlaceRow(Settings):
    """Where a place's raw files are and how they are read."""

    source: str
    folder: str
    settings: Mapping[str, Any]


@dataclass(frozen=True)
class FoldRow(Settings):
    """Sets that a fold trains on and tests; in `train` a word may stand for some (`stages.folds`)."""

    test: tuple[str, ...]
    train: tuple[str, ...] = ()


@dataclass(frozen=True)
class ExportRow(Settings):
    """A network as a model folder."""

    network: str
    weights: str
    tracker: str


@dataclass(frozen=True)
class PromiseRow(Settings):
    """Largest error of the exported network over that of a simple method."""

    method: str
    most: Annotated[float, In("(0, 10]")]


@dataclass(frozen=True)
class OnlineRows(Settings):
    """What is exported, and what is promised of it."""

    exports: Mapping[str, ExportRow]
    promises: Mapping[str, PromiseRow]


@dataclass(frozen=True)
class SceneRow(Settings):
    """A recorded scene, and the networks whose forecasts are shown in it."""

    scene: str
    networks: str


@dataclass(frozen=True)
class RecordingRows(Settings):
    """What recordings show."""

    methods: tuple[str, ...]
    scenes: Mapping[str, SceneRow]
    animation: Animation


@dataclass(frozen=True)
class Reference(Settings):
    """The method that differences are taken to."""

    reference: str


@dataclass(frozen=True)
class PageRows(Settings):
    """What the page holds.

    Attributes:
        replays: study -> scenes that it replays.
        avif_speed: of the encoder of its pictures, from 0, smallest files, to 10, fastest.
    """

    replays: Mapping[str, Sequence[str]]
    avif_speed: Annotated[int, In("[0, 10]")]


@dataclass(frozen=True, kw_only=True)
class ComparisonRows(Settings):
    """What is compared on ETH and UCY.

    Attributes:
        networks: rows of methods.networks.
        samples: number of paths of which the best one counts.
        seeds: of the trainings of each fold.
        scenes: scene -> its recordings, which are pooled.
    """

    networks: tuple[str, ...]
    samples: Annotated[int, In("[1, 1000]")]
    seeds: Annotated[tuple[int, ...], In(f"[0, {LARGEST_SEED}]")]
    scenes: Mapping[str, Sequence[str]]
