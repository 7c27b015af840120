"""Forecasts of a network without memory for many instants at once: what a replay gives, faster."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from tqdm import tqdm

from pedpred.errors import ValueRuleError
from pedpred.forecasting import ForecastRequest
from pedpred.forecasting.blocks import forecast_blocks
from pedpred.online.caution import have_just_appeared, moving_shares, shorten_paths
from pedpred.online.predictor import OnlinePredictor
from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S


def predictions_in_blocks(
    predictor: OnlinePredictor, request: ForecastRequest, title: str
) -> Iterator[tuple[np.ndarray, Predictions]]:
    """Forecast the rows of a request as `OnlinePredictor.update` does at their instants, block by block.

    Args:
        predictor: its network has no memory.
        request: its tracks were made with the predictor's tracker.
        title: of the progress bar.

    Yields:
        See `forecast_blocks`.

    Raises:
        ValueRuleError: the network gives no valid forecast for somebody.
    """
    settings, about, tracks = predictor.settings, predictor.description, request.past
    present_s = settings.max_age_s + TIME_TOLERANCE_S
    request = replace(request, detection_interval_s=present_s / request.sizes.max_age_intervals)
    share = _moving_shares(predictor, request)

    def infer(row: np.ndarray, inputs: Mapping[str, np.ndarray]) -> Predictions:
        graph = about.features.graph_inputs(inputs)
        answer = predictor.network.step({name: graph[name] for name in about.inputs}, {})
        if not answer.sound.all():
            lost = tracks.track_id[row[~answer.sound]]
            raise ValueRuleError("track_id", lost.tolist(), "the network gives no valid forecast for them")
        return answer.predictions

    progress = partial(tqdm, desc=title, unit="block")
    for which, block in forecast_blocks(request, about.features, infer, predictor.postprocessing, progress):
        row = request.rows[which]
        here = tracks.position_at(row, request.table.time_s[row])
        yield which, shorten_paths(block, here, share[which])


def _moving_shares(predictor: OnlinePredictor, request: ForecastRequest) -> np.ndarray:
    """See `pedpred.online.caution`. [W]."""
    tracks, row = request.past, request.rows
    first = row - tracks.age[row]
    new = have_just_appeared(tracks.time_s[row] - tracks.time_s[first], tracks.kept_before(row))
    noise_m = max(predictor.description.tracker.position_noise_m, predictor.settings.detection_noise_m)
    return moving_shares(tracks.detection[first], tracks.detection[row], new, tracks.covariance[row], noise_m)
