"""Forecasts of a network without memory for many instants at once: what a replay gives, faster."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from tqdm import tqdm

from pedpred.errors import ValueRuleError
from pedpred.features.situation import tracked_situations
from pedpred.forecasting import ForecastRequest
from pedpred.forecasting.regions import Instants, learned_in_parts
from pedpred.forecasting.selection import consistent
from pedpred.online.caution import NEWBORN, YOUNG_S, moving_shares, shortened
from pedpred.online.predictor import OnlinePredictor
from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_ROWS_AT_ONCE = 512


def predictions_in_blocks(
    predictor: OnlinePredictor, request: ForecastRequest, title: str
) -> Iterator[tuple[np.ndarray, Predictions]]:
    """Forecast the rows of a request as `OnlinePredictor.update` does at their instants, block by block.

    Forecasts of everybody at all instants would take gigabytes; one block is in memory at a time.

    Args:
        predictor: its network has no memory (`ModelDescription.reads_situations`).
        request: its tracks were made with the predictor's tracker.
        title: of the progress bar.

    Yields:
        Which of the rows to forecast, at whole instants, in the order of time [B]; their predictions, world
        frame [B].
    """
    settings, sizes, tracks = predictor.settings, request.sizes, request.past
    present_s = settings.max_age_s + TIME_TOLERANCE_S
    request = replace(request, detection_interval_s=present_s / sizes.max_age_intervals)
    row, time_s, asked = request.present()
    share = _moving_shares(predictor, request)
    order = np.argsort(asked, kind="stable")
    blocks = instant_blocks(time_s)
    parts = _alone(predictor, request, row, time_s, tqdm(blocks, desc=title, unit="block"))
    scaled = learned_in_parts(parts, settings.detection_noise_m, sizes.lost_after_s)
    for (at, end), everybody in zip(blocks, scaled, strict=True):
        which = order[slice(*np.searchsorted(asked, [at, end], sorter=order))]
        if len(which):
            own = asked[which]
            here = tracks.position_at(row[own], time_s[own])
            yield which, shortened(everybody.select(own - at), here, share[which])


def instant_blocks(time_s: np.ndarray) -> list[tuple[int, int]]:
    """First row and end of blocks of whole instants: the people of one choose together. [C], rising."""
    starts = np.flatnonzero(np.diff(time_s, prepend=-np.inf) > TIME_TOLERANCE_S)
    edges = starts[np.diff(starts // _ROWS_AT_ONCE, prepend=-1) > 0].tolist()
    return list(pairwise([*edges, len(time_s)]))


def _alone(
    predictor: OnlinePredictor,
    request: ForecastRequest,
    row: np.ndarray,
    time_s: np.ndarray,
    blocks: Iterable[tuple[int, int]],
) -> Iterator[Instants]:
    """Forecast everybody present, before regions have learned; rows [C] of tracks at their instants [C]."""
    about, tracks, occupancy = predictor.description, request.past, request.scene.occupancy
    present_s, kept = predictor.settings.max_age_s + TIME_TOLERANCE_S, tracks.kept()
    for at, end in blocks:
        own, now_s = row[at:end], time_s[at:end]
        inputs = tracked_situations(tracks, own, now_s, occupancy, request.sizes, present_s)
        answer = predictor.network.step({name: inputs[name] for name in about.inputs}, {})
        if not answer.sound.all():
            lost = tracks.track_id[own[~answer.sound]]
            raise ValueRuleError("track_id", lost.tolist(), "the network gives no valid forecast for them")
        here = tracks.position_at(own, now_s)
        chosen = consistent(answer.predictions.in_world(here, tracks.heading_rad[own]), here, now_s)
        seen = (tracks.time_s[own] > now_s - TIME_TOLERANCE_S) & kept[own]
        yield chosen, tracks.life[own], now_s, tracks.detection[own], seen


def _moving_shares(predictor: OnlinePredictor, request: ForecastRequest) -> np.ndarray:
    """See `pedpred.online.caution`. [W]."""
    tracks, row = request.past, request.rows
    first = row - tracks.age[row]
    young = tracks.time_s[row] - tracks.time_s[first] < YOUNG_S - TIME_TOLERANCE_S
    new = young | (tracks.kept_before(row) < NEWBORN)
    noise_m = predictor.description.tracker.position_noise_m
    return moving_shares(tracks.detection[first], tracks.detection[row], new, tracks.covariance[row], noise_m)
