"""Rows of the configuration: where places come from, and what is tested, exported, promised and shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from pedpred.fields import Range, check_ranges, parsed, parsed_each
from pedpred.report.animation import Animation


class Texts:
    """A row whose fields are texts, lists of them, or true and false."""

    def __post_init__(self) -> None:
        check_ranges(self, {})


@dataclass(frozen=True)
class PlaceRow(Texts):
    """Where a place's raw files are and how they are read."""

    source: str
    folder: str
    settings: Mapping[str, Any]


@dataclass(frozen=True)
class FoldRow(Texts):
    """Sets that a fold trains on and tests."""

    test: tuple[str, ...]
    train: tuple[str, ...] = ()


@dataclass(frozen=True)
class ExportRow(Texts):
    """A network as a model folder."""

    networks: str
    network: str
    tracker: str


@dataclass(frozen=True)
class PromiseRow:
    """Largest error of the exported network over that of a simple method."""

    method: str
    most: float

    def __post_init__(self) -> None:
        check_ranges(self, {"most": "(0, 10]"})


@dataclass(frozen=True)
class OnlineRows:
    """What is exported, and what is promised of it."""

    exports: Mapping[str, ExportRow] = field(metadata={"parse": partial(parsed_each, ExportRow)})
    promises: Mapping[str, PromiseRow] = field(metadata={"parse": partial(parsed_each, PromiseRow)})


@dataclass(frozen=True)
class SceneRow(Texts):
    """A recorded scene, and the networks whose forecasts are shown in it."""

    scene: str
    networks: str


@dataclass(frozen=True)
class RecordingRows(Texts):
    """What recordings show."""

    methods: tuple[str, ...]
    scenes: Mapping[str, SceneRow] = field(metadata={"parse": partial(parsed_each, SceneRow)})
    animation: Animation = field(metadata={"parse": partial(parsed, Animation)})


@dataclass(frozen=True)
class Reference(Texts):
    """The method that differences are taken to."""

    reference: str


@dataclass(frozen=True)
class PageRows:
    """What the page holds.

    Attributes:
        replays: study -> scenes that it replays.
        avif_speed: of the encoder of its pictures, from 0, smallest files, to 10, fastest.
    """

    replays: Mapping[str, Sequence[str]]
    avif_speed: int

    def __post_init__(self) -> None:
        check_ranges(self, {"avif_speed": "[0, 10]"})


@dataclass(frozen=True)
class PublishedRow:
    """Errors that others published under the protocol of `pedpred.literature`.

    Attributes:
        name: of their method.
        samples: number of forecasts the best of which counts.
        errors_m: scene, or "mean" of all five -> (ADE, FDE).
        remark: how theirs was measured.
    """

    name: str
    samples: int
    errors_m: Mapping[str, Range]
    remark: str = ""

    def __post_init__(self) -> None:
        check_ranges(self, {"errors_m": "(0, 1000]", "samples": "[1, 1000]"})


@dataclass(frozen=True)
class PublishedRows:
    """What others published."""

    published: Sequence[PublishedRow] = field(metadata={"each": partial(parsed, PublishedRow)})
