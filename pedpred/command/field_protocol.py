"""`pedpred evaluate --protocol eth-ucy`: the windows and figures that the literature compares."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.command.foreign import ForeignForecasts, has_all_forecasts
from pedpred.command.tables import align_columns
from pedpred.errors import ValueRuleError
from pedpred.evaluation import MetricSettings, Scores, given, measure
from pedpred.evaluation.measure import BEST_ADE, BEST_FDE
from pedpred.evaluation.observed import WindowSettings, find_observed_windows
from pedpred.features.perception import Perception, fitted
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.online.assessment import NETWORK
from pedpred.online.batch import predictions_in_blocks
from pedpred.online.network import ModelDescription
from pedpred.online.predictor import OnlinePredictor
from pedpred.scenes import Predictions, Scene

PROTOCOL = "eth-ucy"
WINDOWS = WindowSettings(observed_steps=8, predicted_steps=12, step_s=0.4)
SAMPLES = 20
_SHOWN = {
    "ade_m": "ADE m", "fde_m": "FDE m", "most_likely_ade_m": "most likely ADE m",
    BEST_ADE: f"best of {SAMPLES} ADE m", BEST_FDE: "FDE m", "nll": "NLL nats",
}  # fmt: skip
_SAME_S = 1e-3
_LOG = logging.getLogger(__name__)


def assess_windows(
    scene: Scene,
    predictor: OnlinePredictor,
    is_named: bool,
    settings: MetricSettings,
    foreign: Mapping[str, ForeignForecasts],
) -> dict[str, Scores]:
    """Measure simple methods, a model and forecasts of other programs in the windows of a recording.

    Args:
        scene: annotations every 0.4 s.
        predictor: with the model.
        is_named: the user named the model, so that one of another time step or horizon is an error.
        settings: thresholds of the metrics.
        foreign: forecasts of other programs by name; windows without one in each of them are left out.

    Raises:
        ValueRuleError: the recording has no window, or the model forecasts other steps.
        InputError: a file of forecasts does not belong to the windows.
    """
    if abs(scene.detection_dt_s - WINDOWS.step_s) > _SAME_S:
        rule = f"this protocol needs annotations every {WINDOWS.step_s:g} s"
        raise ValueRuleError("protocol", f"{scene.name}, every {scene.detection_dt_s:g} s", rule)
    about = predictor.description
    how = Perception(predictor.filters, about.standstill_mps)
    windows = find_observed_windows(scene, how, WINDOWS, memory=False)
    simple = find_observed_windows(scene, fitted(scene, how, WINDOWS.protocol), WINDOWS, memory=False).request
    # Files of forecasts have the ids and times of the recording, windows their own.
    recorded = replace(windows.request.asked, track_id=windows.track, time_s=windows.time_s)
    named = replace(windows.request, table=recorded, rows=np.arange(len(windows)), tracks=None)
    if foreign:
        kept = has_all_forecasts(foreign, named)
        windows, named = windows.select(kept), replace(named, rows=named.rows[kept])
    simple = replace(simple, rows=windows.request.rows)
    methods: dict[str, Forecaster] = {key: given(make()(simple)) for key, make in PRESENT_MOTION.items()}
    if _fits(about, is_named):
        methods[NETWORK] = partial(_forecast, predictor)
    methods |= {name: given(forecasts(named)) for name, forecasts in foreign.items()}
    return measure(windows, methods, settings, samples=SAMPLES)


def _fits(about: ModelDescription, is_named: bool) -> bool:
    """Whether a model has the steps of the protocol.

    Raises:
        ValueRuleError: the model that the user named has not.
    """
    sizes = about.protocol
    if (sizes.dt_s, sizes.horizon_steps) == (WINDOWS.step_s, WINDOWS.predicted_steps) and not about.memory:
        return True
    has = f"{sizes.horizon_steps} steps of {sizes.dt_s:g} s{' and a memory' if about.memory else ''}"
    rule = f"this protocol needs {WINDOWS.predicted_steps} steps of {WINDOWS.step_s:g} s, without memory"
    if is_named:
        raise ValueRuleError("model", has, rule)
    _LOG.info("the default model is left out: it forecasts %s, and %s", has, rule)
    return False


def _forecast(predictor: OnlinePredictor, request: ForecastRequest) -> Predictions:
    """The model's forecasts of the windows, in their order."""
    blocks = predictions_in_blocks(predictor, request, f"forecast {request.scene.name}")
    which, parts = zip(*blocks, strict=True)
    return Predictions.join(parts).select(np.argsort(np.concatenate(which)))


def protocol_table(name: str, scores: Mapping[str, Scores]) -> str:
    """Write the figures of a scene: a row per method."""
    cells = [["method", *_SHOWN.values()]]
    for method, measures in scores.items():
        means = [measures.values[key].mean() for key in _SHOWN]
        cells.append([method, *("-" if np.isnan(mean) else f"{mean:.3f}" for mean in means)])
    count = len(next(iter(scores.values())).track)
    about = f"{name}: {count} windows of {WINDOWS.observed_steps} + {WINDOWS.predicted_steps} annotations"
    return align_columns(about, cells)
