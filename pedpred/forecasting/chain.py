"""From what a network says of each person alone to forecasts: the same for replays, batches and robots.

In this order: world frame; paths move towards straight lines as far as earlier forecasts of the network were
worse than these (`pedpred.forecasting.trust`); people who are forecast together choose their modes together
(`pedpred.forecasting.selection`); regions of probability are scaled by what was learned from earlier
forecasts (`pedpred.forecasting.regions`). A robot then shortens the forecasts of people who have just
appeared (`pedpred.online.caution`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from pedpred.features import ModelFeatures
from pedpred.forecasting.instants import Instants
from pedpred.forecasting.regions import Regions, learn_regions
from pedpred.forecasting.request import ForecastRequest
from pedpred.forecasting.selection import choose_modes
from pedpred.forecasting.trust import Trust, learn_trust
from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_ROWS_AT_ONCE = 2048

Infer = Callable[[np.ndarray, Mapping[str, np.ndarray]], Predictions]
"""Agent-frame predictions of some people, from the rows of their last detections and a model's inputs."""


@dataclass(frozen=True)
class Chain:
    """Which links there are.

    Attributes:
        together: people choose their modes together.
        learning: regions learn from earlier forecasts.
        noise_m: standard deviation of a detection's coordinate, see `Regions`.
        trust: trust in the network beside straight lines is learned from earlier forecasts.
    """

    together: bool = True
    learning: bool = True
    noise_m: float = 0.0
    trust: bool = False


@dataclass(frozen=True)
class Place:
    """What was learned at a place from earlier forecasts.

    Attributes:
        trust: in the network beside straight lines; None: it is trusted alone.
        regions: how large they are.
    """

    trust: Trust | None
    regions: Regions

    @classmethod
    def unlearned(cls, steps: int, noise_m: float = 0.0, trust: bool = False) -> Place:
        """Before the first instant; see `Chain` for the arguments."""
        return cls(Trust.unlearned(steps) if trust else None, Regions.unlearned(steps, noise_m, trust))

    def without_people(self) -> Place:
        """What was learned, with nobody to learn from."""
        return Place(self.trust and self.trust.without_people(), self.regions.without_people())

    def plain(self) -> dict[str, Any]:
        """What was learned, as lists of numbers."""
        return {"trust": self.trust and self.trust.plain(), "regions": self.regions.plain()}

    def relearned(self, plain: Mapping[str, Any]) -> Place:
        """Of an unlearned one: with what another one had learned; trust stays None where it is.

        Raises:
            ValueRuleError: a value breaks its rule.
        """
        trust, regions = self.trust, self.regions.relearned(plain["regions"])
        if trust is not None and plain["trust"] is not None:
            trust = trust.relearned(plain["trust"])
        return Place(trust, regions)


def forecast_instant(
    place: Place,
    alone: Predictions,
    position: np.ndarray,
    time_s: float,
    person: np.ndarray,
    detection: np.ndarray,
    seen: np.ndarray,
) -> tuple[Place, Predictions]:
    """Apply all links to the people of one instant.

    Args:
        place: what was learned before.
        alone: world frame. [N]
        position: where people are, world frame, m. [N, 2]
        time_s: the instant, s.
        person: see `Regions.after`. [N]
        detection: see there. [N, 2]
        seen: see there. [N]

    Returns:
        What is learned afterwards, and the forecasts.
    """
    trust = place.trust
    if trust is not None:
        trust, alone = trust.after(time_s, person, detection, seen, alone)
    chosen = choose_modes(alone, position, np.full(len(alone), time_s))
    regions, scaled = place.regions.after(time_s, person, detection, seen, chosen)
    return Place(trust, regions), scaled


def forecast_blocks(
    request: ForecastRequest,
    features: ModelFeatures,
    infer: Infer,
    chain: Chain,
    progress: Callable[[list[tuple[int, int]]], Iterable[tuple[int, int]]] = iter,
) -> Iterator[tuple[np.ndarray, Predictions]]:
    """Forecast the rows of a request at their instants, block by block, which bounds the memory.

    Everybody present is forecast, not only who is asked for, because people choose together.

    Args:
        request: about tracked people.
        features: of the model.
        infer: the model, without memory.
        chain: which links there are.
        progress: shows how far the blocks are.

    Yields:
        Which of the rows to forecast, at whole instants, in the order of time [B]; their predictions, world
        frame [B].
    """
    row, time_s, asked = request.present()
    order = np.argsort(asked, kind="stable")
    blocks = instant_blocks(time_s)
    parts = _alone(request, features, infer, row, time_s, progress(blocks))
    lost_after_s = request.sizes.lost_after_s
    if chain.trust:
        parts = learn_trust(parts, lost_after_s)
    if chain.together:
        parts = _together(request, parts, row)
    if chain.learning:
        parts = learn_regions(parts, chain.noise_m, lost_after_s, chain.trust)
    for (at, end), (everybody, *_) in zip(blocks, parts, strict=True):
        which = order[slice(*np.searchsorted(asked, [at, end], sorter=order))]
        if len(which):
            yield which, everybody.select(asked[which] - at)


def instant_blocks(time_s: np.ndarray) -> list[tuple[int, int]]:
    """First row and end of blocks of whole instants: the people of one choose together. [C], rising."""
    starts = np.flatnonzero(np.diff(time_s, prepend=-np.inf) > TIME_TOLERANCE_S)
    edges = starts[np.diff(starts // _ROWS_AT_ONCE, prepend=-1) > 0].tolist()
    return list(pairwise([*edges, len(time_s)]))


def _alone(
    request: ForecastRequest,
    features: ModelFeatures,
    infer: Infer,
    row: np.ndarray,
    time_s: np.ndarray,
    blocks: Iterable[tuple[int, int]],
) -> Iterator[Instants]:
    """Forecast everybody present, each alone; rows [C] of tracks at their instants [C]."""
    tracks = request.past
    kept = tracks.kept()
    for at, end in blocks:
        instant, now_s = row[at:end], time_s[at:end]
        here = tracks.position_at(instant, now_s)
        alone = infer(instant, request.inputs(features, instant, now_s)).in_world(
            here, tracks.heading_rad[instant]
        )
        seen = (tracks.time_s[instant] > now_s - TIME_TOLERANCE_S) & kept[instant]
        yield alone, tracks.life[instant], now_s, tracks.detection[instant], seen


def _together(request: ForecastRequest, parts: Iterable[Instants], row: np.ndarray) -> Iterator[Instants]:
    """Let people choose their modes together; rows [C] of tracks in the order of the parts."""
    at = 0
    for alone, person, now_s, detection, seen in parts:
        here = request.past.position_at(row[at : at + len(alone)], now_s)
        at += len(alone)
        yield choose_modes(alone, here, now_s), person, now_s, detection, seen
