"""Forecasts of networks without memory for all rows of a request, at all instants of a scene."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import pairwise

import numpy as np

from pedpred.features import ModelFeatures
from pedpred.forecasting.postprocessing import Postprocessing
from pedpred.forecasting.request import ForecastRequest
from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_ROWS_AT_ONCE = 2048

Infer = Callable[[np.ndarray, Mapping[str, np.ndarray]], Predictions]
"""Agent-frame predictions of some people, from the rows of their last detections and a model's inputs."""


def forecast_blocks(
    request: ForecastRequest,
    features: ModelFeatures,
    infer: Infer,
    postprocessing: Postprocessing,
    progress: Callable[[list[tuple[int, int]]], Iterable[tuple[int, int]]] = iter,
) -> Iterator[tuple[np.ndarray, Predictions]]:
    """Forecast the rows of a request at their instants, block by block, which bounds the memory.

    Everybody present is forecast, not only who is asked for, because people choose together.

    Args:
        request: about tracked people.
        features: of the model.
        infer: the model, without memory.
        postprocessing: which steps follow the network.
        progress: shows how far the blocks are.

    Yields:
        Which of the rows to forecast, at whole instants, in the order of time [B]; their predictions, world
        frame [B].
    """
    row, time_s, asked = request.present()
    order = np.argsort(asked, kind="stable")
    tracks, lost_s = request.past, request.sizes.lost_after_s + TIME_TOLERANCE_S
    position, kept = tracks.position_at(row, time_s), tracks.kept()
    place, before_s = postprocessing.initial(request.sizes.horizon_steps), np.inf
    for at, end in progress(instant_blocks(time_s)):
        block, now_s = row[at:end], time_s[at:end]
        alone = infer(block, request.inputs(features, block, now_s)).in_world(
            position[at:end], tracks.heading_rad[block]
        )
        seen = (tracks.time_s[block] > now_s - TIME_TOLERANCE_S) & kept[block]
        parts = []
        for rows in _instants(now_s):
            if now_s[rows[0]] - before_s > lost_s:
                place = place.without_people()
            own, before_s = block[rows], now_s[rows[-1]]
            known = float(now_s[rows[0]]), tracks.life[own], tracks.detection[own], seen[rows]
            place, forecasts = postprocessing.apply(place, alone.select(rows), position[at:end][rows], *known)
            parts.append(forecasts)
        which = order[slice(*np.searchsorted(asked, [at, end], sorter=order))]
        if len(which):
            yield which, Predictions.join(parts).select(asked[which] - at)


def instant_blocks(time_s: np.ndarray) -> list[tuple[int, int]]:
    """First row and end of blocks of whole instants: the people of one choose together. [C], rising."""
    starts = np.flatnonzero(np.diff(time_s, prepend=-np.inf) > TIME_TOLERANCE_S)
    edges = starts[np.diff(starts // _ROWS_AT_ONCE, prepend=-1) > 0].tolist()
    return list(pairwise([*edges, len(time_s)]))


def _instants(time_s: np.ndarray) -> list[np.ndarray]:
    """Rows of each instant; times never fall. [C]."""
    later = np.flatnonzero(np.diff(time_s) > TIME_TOLERANCE_S) + 1
    return np.split(np.arange(len(time_s)), later)
