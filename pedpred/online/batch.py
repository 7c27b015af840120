"""Forecasts of a network without memory for many instants at once: what a replay gives, faster."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tqdm import tqdm

from pedpred.errors import ValueRuleError
from pedpred.features.situation import tracked_situations
from pedpred.forecasting import ForecastRequest
from pedpred.forecasting.regions import learned
from pedpred.forecasting.selection import consistent
from pedpred.online.caution import NEWBORN, YOUNG_S, moving_shares, shortened
from pedpred.online.predictor import OnlinePredictor
from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_ROWS_AT_ONCE = 512


def predictions_at_once(predictor: OnlinePredictor, request: ForecastRequest, title: str) -> Predictions:
    """Forecast the rows of a request as `OnlinePredictor.update` does at their instants.

    Args:
        predictor: its network has no memory (`ModelDescription.reads_situations`).
        request: its tracks were made with the predictor's tracker.
        title: of the progress bar.

    Returns:
        World frame. [W]
    """
    about, settings, sizes = predictor.description, predictor.settings, request.sizes
    if not len(request.rows):
        return Predictions.single(np.zeros((0, sizes.horizon_steps, 2)), sizes.dt_s)
    present_s = settings.max_age_s + TIME_TOLERANCE_S
    request = replace(request, detection_interval_s=present_s / sizes.max_age_intervals)
    row, time_s, asked = request.present()
    tracks, occupancy = request.past, request.scene.occupancy
    here, parts = tracks.position_at(row, time_s), []
    # Whole instants: the people of one are each other's neighbours and choose together.
    starts = np.flatnonzero(np.diff(time_s, prepend=-np.inf))
    edges = starts[np.diff(starts // _ROWS_AT_ONCE, prepend=-1) > 0].tolist()
    for at, end in tqdm(list(zip(edges, [*edges[1:], len(row)], strict=True)), desc=title, unit="block"):
        own, now_s = row[at:end], time_s[at:end]
        inputs = tracked_situations(tracks, own, now_s, occupancy, sizes, present_s)
        answer = predictor.network.step({name: inputs[name] for name in about.inputs}, {})
        if not answer.sound.all():
            lost = tracks.track_id[own[~answer.sound]]
            raise ValueRuleError("track_id", lost.tolist(), "the network gives no valid forecast for them")
        there = answer.predictions.in_world(here[at:end], tracks.heading_rad[own])
        parts.append(consistent(there, here[at:end], now_s))
    seen = (tracks.time_s[row] > time_s - TIME_TOLERANCE_S) & tracks.kept()[row]
    person, detection, noise_m = tracks.life[row], tracks.detection[row], settings.detection_noise_m
    joined = Predictions.join(parts)
    everybody = learned(joined, person, time_s, detection, seen, noise_m, sizes.lost_after_s)
    predictions = everybody.select(asked)
    return shortened(predictions, here[asked], _moving_shares(predictor, request))


def _moving_shares(predictor: OnlinePredictor, request: ForecastRequest) -> np.ndarray:
    """See `pedpred.online.caution`. [W]."""
    tracks, row = request.past, request.rows
    first = row - tracks.age[row]
    young = tracks.time_s[row] - tracks.time_s[first] < YOUNG_S - TIME_TOLERANCE_S
    new = young | (tracks.kept_before(row) < NEWBORN)
    noise_m = predictor.description.tracker.position_noise_m
    return moving_shares(tracks.detection[first], tracks.detection[row], new, tracks.covariance[row], noise_m)
