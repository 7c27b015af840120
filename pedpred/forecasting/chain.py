"""From what a network says of each person alone to forecasts: the same for replays, batches and robots.

In this order: world frame; people who are forecast together choose their modes together
(`pedpred.forecasting.selection`); regions of probability are scaled by what was learned from earlier
forecasts (`pedpred.forecasting.regions`). A robot then shortens the forecasts of people who have just
appeared (`pedpred.online.caution`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pedpred.features import ModelFeatures
from pedpred.forecasting.regions import Instants, Regions, learn_regions
from pedpred.forecasting.request import ForecastRequest
from pedpred.forecasting.selection import choose_modes
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
    """

    together: bool = True
    learning: bool = True
    noise_m: float = 0.0


def forecast_instant(
    regions: Regions,
    alone: Predictions,
    position: np.ndarray,
    time_s: float,
    person: np.ndarray,
    detection: np.ndarray,
    seen: np.ndarray,
) -> tuple[Regions, Predictions]:
    """Apply all links to the people of one instant.

    Args:
        regions: what was learned before.
        alone: world frame. [N]
        position: where people are, world frame, m. [N, 2]
        time_s: the instant, s.
        person: see `Regions.after`. [N]
        detection: see there. [N, 2]
        seen: see there. [N]

    Returns:
        What is learned afterwards, and the forecasts.
    """
    chosen = choose_modes(alone, position, np.full(len(alone), time_s))
    return regions.after(time_s, person, detection, seen, chosen)


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
    parts = _chosen(request, features, infer, chain, row, time_s, progress(blocks))
    scaled: Iterator[Predictions] = (part[0] for part in parts)
    if chain.learning:
        scaled = learn_regions(parts, chain.noise_m, request.sizes.lost_after_s)
    for (at, end), everybody in zip(blocks, scaled, strict=True):
        which = order[slice(*np.searchsorted(asked, [at, end], sorter=order))]
        if len(which):
            yield which, everybody.select(asked[which] - at)


def instant_blocks(time_s: np.ndarray) -> list[tuple[int, int]]:
    """First row and end of blocks of whole instants: the people of one choose together. [C], rising."""
    starts = np.flatnonzero(np.diff(time_s, prepend=-np.inf) > TIME_TOLERANCE_S)
    edges = starts[np.diff(starts // _ROWS_AT_ONCE, prepend=-1) > 0].tolist()
    return list(pairwise([*edges, len(time_s)]))


def _chosen(
    request: ForecastRequest,
    features: ModelFeatures,
    infer: Infer,
    chain: Chain,
    row: np.ndarray,
    time_s: np.ndarray,
    blocks: Iterable[tuple[int, int]],
) -> Iterator[Instants]:
    """Forecast everybody present, before regions have learned; rows [C] of tracks at their instants [C]."""
    tracks = request.past
    kept = tracks.kept()
    for at, end in blocks:
        instant, now_s = row[at:end], time_s[at:end]
        here = tracks.position_at(instant, now_s)
        alone = infer(instant, request.inputs(features, instant, now_s)).in_world(
            here, tracks.heading_rad[instant]
        )
        chosen = choose_modes(alone, here, now_s) if chain.together else alone
        seen = (tracks.time_s[instant] > now_s - TIME_TOLERANCE_S) & kept[instant]
        yield chosen, tracks.life[instant], now_s, tracks.detection[instant], seen
