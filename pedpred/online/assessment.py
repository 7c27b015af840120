"""Accuracy of online forecasts in a recording, beside simple methods."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.errors import ValueRuleError
from pedpred.evaluation import EvaluationSettings, Scores, find_windows, given, measure
from pedpred.evaluation.scores import join_scores
from pedpred.features.perception import Perception, fitted, sensed
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.forecasting.blocks import instant_blocks
from pedpred.metrics import Metric
from pedpred.online.batch import predictions_in_blocks
from pedpred.online.predictor import OnlinePredictor
from pedpred.online.replay import predictions_at, replay_with_progress
from pedpred.scenes import Forecast, Predictions, Scene
from pedpred.simulation.sensor import SensorSettings
from pedpred.tracking.tracks import TIME_TOLERANCE_S

NETWORK = "network"
"""Name of the exported network beside the other methods."""
ALWAYS = (*PRESENT_MOTION, NETWORK)
"""The methods of every assessment."""


def assess(
    scene: Scene,
    predictor: OnlinePredictor,
    settings: EvaluationSettings,
    sensor: SensorSettings | None = None,
    others: Mapping[str, Forecaster] | None = None,
    answered: Callable[[ForecastRequest], np.ndarray] | None = None,
    metrics: Mapping[str, Metric] | None = None,
) -> dict[str, Scores]:
    """Measure the network in a scene, beside the baselines that continue the present motion.

    The windows are those of the pipeline (`find_windows`); the detections themselves, joined by a spline, are
    the truth. The tracker of the simple methods is fitted to the scene itself, see
    `pedpred.features.perception.fitted`.

    Args:
        scene: detections at any rate, regular or not.
        predictor: its window sizes are used for all methods.
        settings: thresholds of the metrics.
        sensor: between the scene and the tracker; None for a perfect one.
        others: further methods by name, without memory; no name of `ALWAYS`.
        answered: which windows count, [W] bool; None: all, and then detections without truth are counted.
        metrics: which ones alone; None: all, and errors and calibration at each step.

    Raises:
        ValueRuleError: the scene has no window, or a further method has the name of one of `ALWAYS`.

    Returns:
        The scores of each method in the same windows.
    """
    if taken := sorted(set(others or {}).intersection(ALWAYS)):
        raise ValueRuleError("others", taken, f"the names {ALWAYS} are taken")
    about, sensor = predictor.description, sensor or SensorSettings()
    how = Perception(predictor.filters, about.standstill_mps, sensor)
    windows = find_windows(scene, how, predictor.protocol, memory=False)
    # Detections need not be regular, so that no single covariance of the tracker holds for all of them.
    windows = replace(windows, request=replace(windows.request, tracker=None))
    if answered is not None:  # of detections without truth, nobody knows whether they would count
        windows = replace(windows.select(answered(windows.request)), without_truth=0)
    best = fitted(scene, how, predictor.protocol)
    simple = find_windows(scene, best, predictor.protocol, memory=False).request
    simple = replace(simple, rows=windows.request.rows, tracker=None)
    straight = {key: make()(simple) for key, make in PRESENT_MOTION.items()}
    del simple
    scores: dict[str, list[Scores]] = {name: [] for name in (*ALWAYS, *(others or {}))}
    order = []
    for which, forecast in forecasts_by_instants(predictor, windows.request, sensed(scene, sensor)):
        block = windows.select(which)  # whole instants, since some metrics compare the people of one
        known = {key: paths.select(which) for key, paths in straight.items()} | {NETWORK: forecast}
        forecasters = {key: given(paths) for key, paths in known.items()} | dict(others or {})
        for name, part in measure(block, forecasters, settings, metrics).items():
            scores[name].append(_kept(part, metrics is None))
        order.append(which)
    del windows, block  # only the scores are needed from here on
    joined: dict[str, Scores] = {}
    for name in list(scores):
        whole = join_scores(scores.pop(name), np.concatenate(order))
        joined[name] = replace(whole, track=next(iter(joined.values()), whole).track)
    return joined


def forecasts_by_instants(
    predictor: OnlinePredictor, request: ForecastRequest, seen: Scene
) -> Iterator[tuple[np.ndarray, Predictions]]:
    """Forecast windows as a robot does: at once without memory, else frame by frame.

    Args:
        predictor: the robot's.
        request: its tracks were made with the predictor's tracker.
        seen: the detections of these tracks.

    Yields:
        See `pedpred.online.batch.predictions_in_blocks`.
    """
    if predictor.description.memory:
        return _replayed(seen, predictor, request)
    return predictions_in_blocks(predictor, request, f"forecast {seen.name}")


def _kept(scores: Scores, steps: bool) -> Scores:
    """Scores in arrays of their own, since a view keeps all that it is a part of; without steps if asked."""
    values = {key: array if array.base is None else array.copy() for key, array in scores.values.items()}
    return replace(scores, values=values, error_m=scores.error_m if steps else scores.error_m[:, :0].copy())


def _replayed(
    seen: Scene, predictor: OnlinePredictor, request: ForecastRequest
) -> Iterator[tuple[np.ndarray, Predictions]]:
    """Forecasts of a network with memory, frame by frame; see `predictions_in_blocks`."""
    forecasts, sizes = replay_with_progress(seen, predictor), request.sizes
    track_id, time_s = (getattr(request.table, name)[request.rows] for name in ("track_id", "time_s"))
    order = np.argsort(time_s, kind="stable")
    for begin, end in instant_blocks(time_s[order]):
        which = order[begin:end]
        now_s = time_s[which]
        latest = _until(forecasts, now_s[-1])
        yield which, predictions_at(latest, track_id[which], now_s, sizes.horizon_steps, sizes.dt_s)


def _until(forecasts: Iterator[Forecast], time_s: float) -> Iterator[Forecast]:
    """The next forecasts up to that of an instant."""
    for forecast in forecasts:
        yield forecast
        if forecast.time_s >= time_s - TIME_TOLERANCE_S:
            return
