"""All metrics of one forecaster in every evaluation window."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np

from pedpred.errors import InputError, ValueRuleError, shape_error
from pedpred.files import translate_errors
from pedpred.metrics import METRICS, Metric, MetricScene
from pedpred.metrics.calibration import mixture_nll, share_inside
from pedpred.metrics.paths import displacement
from pedpred.scenes import Predictions
from pedpred.settings import LARGEST_SEED, In, Settings
from pedpred.storage.columns import column_names, read_about, read_columns, write_columns

_PER_STEP = ("error_m", "inside", "nll")
_METRIC = "metric_"


@dataclass(frozen=True, kw_only=True)
class MetricSettings(Settings):
    """Thresholds of the metrics; defaults: published figures.

    Attributes:
        moving_mps: slower people count as standing.
        collision_m: people forecast nearer than this at the same step collide.
        miss_m: a forecast whose last position is farther off than this is a miss.
    """

    moving_mps: Annotated[float, In("(0, 1e6]")] = 0.3
    collision_m: Annotated[float, In("(0, 1e6]")] = 0.2
    miss_m: Annotated[float, In("(0, 1e6]")] = 2.0


@dataclass(frozen=True, kw_only=True)
class Resampling(Settings):
    """Size of the bootstrap behind intervals.

    Attributes:
        bootstrap: replicates.
        seed: of the bootstrap.
    """

    bootstrap: Annotated[int, In("[1, 100000]")] = 1000
    seed: Annotated[int, In(f"[0, {LARGEST_SEED}]")] = 0


@dataclass(frozen=True, kw_only=True)
class EvaluationSettings(MetricSettings, Resampling):
    """`MetricSettings` and `Resampling` in one, for callers that measure and compare."""


@dataclass(frozen=True)
class Scores:
    """Results per window, kept until the end so that any pooling is exact.

    Attributes:
        track: of each window, for the bootstrap. [W]
        values: metric -> value of each window, NaN where it does not apply. {key: [W]}
        error_m: displacement at each forecast step, m. [W, P]
        inside: see `metrics.calibration.share_inside`; no columns without covariances or if not asked for.
            [W, P] or [W, 0]
        nll: negative log likelihood of the truth, nats; no columns likewise. [W, P] or [W, 0]
        without_truth: number of detections that are no windows because their truth has gaps.
        noncausal: the inputs knew the future.
    """

    track: np.ndarray
    values: Mapping[str, np.ndarray]
    error_m: np.ndarray
    inside: np.ndarray
    nll: np.ndarray
    without_truth: int = 0
    noncausal: bool = False


def score(
    predictions: Predictions,
    truth: np.ndarray,
    track: np.ndarray,
    scene: MetricScene,
    metrics: Mapping[str, Metric] = METRICS,
    steps: bool = True,
) -> Scores:
    """Measure one forecaster in one scene.

    Args:
        predictions: world frame. [W]
        truth: world frame, m. [W, P, 2]
        track: of each window. [W]
        scene: of the windows.
        metrics: which ones.
        steps: measure the calibration at each step, the slowest of all.

    Raises:
        ValueRuleError: a window has no forecast, or one that some metrics cannot measure; forecasts are not
            in the world frame, or of another number or length than the truth; or a metric gives something
            else than a value per window.
    """
    if predictions.frame != "world":
        rule = "it must be 'world': a method gives what `in_world` of its predictions returns"
        raise ValueRuleError("predictions.frame", predictions.frame, rule)
    if predictions.point.shape != truth.shape:
        raise shape_error("predictions.point", predictions.point.shape, f"{truth.shape}, as the truth has")
    _check_all_forecast(predictions)
    inside = nll = np.zeros((len(predictions), 0))
    if steps and predictions.covariance is not None:
        inside, nll = share_inside(predictions, truth), mixture_nll(predictions, truth)
    values = {key: metric.value(predictions, truth, scene) for key, metric in metrics.items()}
    for key, of_windows in values.items():
        if np.shape(of_windows) != track.shape:
            raise shape_error(f"metrics.{key}", np.shape(of_windows), f"{track.shape}, a value per window")
    return Scores(track, values, displacement(predictions.point, truth), inside, nll)


def _check_all_forecast(predictions: Predictions) -> None:
    """Check that a method can be measured in every window, so that no mean leaves some out.

    Raises:
        ValueRuleError: a position is not finite, or a covariance is not positive definite.
    """
    if not (np.isfinite(predictions.point).all() and np.isfinite(predictions.path).all()):
        raise ValueRuleError("predictions", "not finite", "a method must forecast every window")
    if predictions.covariance is None:
        return
    covariance = np.asarray(predictions.covariance, np.float64)
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    definite = (xx > 0) & (xx * yy > xy**2) & np.isfinite(xx * yy)
    if not definite.all():
        window, mode, step = np.argwhere(~definite)[0].tolist()
        rule = f"that of window {window}, mode {mode}, step {step + 1} must be positive definite"
        raise ValueRuleError("covariance", covariance[window, mode, step].tolist(), rule)


def join_scores(parts: Sequence[Scores], row: np.ndarray) -> Scores:
    """Put the scores of some windows at a time together.

    Args:
        parts: at least one.
        row: where each of their windows belongs. [W]
    """
    at = np.argsort(row)
    values = {key: np.concatenate([part.values[key] for part in parts])[at] for key in parts[0].values}
    track, error_m, inside, nll = (
        np.concatenate([getattr(part, name) for part in parts])[at] for name in ("track", *_PER_STEP)
    )
    return replace(parts[0], track=track, values=values, error_m=error_m, inside=inside, nll=nll)


def mean_scores(scores: Sequence[Scores]) -> Scores:
    """The mean over networks that differ in their seed alone, window by window; without shares in regions.

    Whether a region holds the truth is a question to each network: a mean share answers it for none.
    """
    first = scores[0]
    values = {key: np.mean([each.values[key] for each in scores], axis=0) for key in first.values}
    steps = {n: np.mean([getattr(each, n) for each in scores], axis=0) for n in ("error_m", "nll")}
    return replace(first, values=values, inside=first.inside[:, :0], **steps)


def check_alike(field: str, names: Collection[str], others: Collection[str]) -> None:
    """Check that results which are pooled or compared are of the same methods or metrics.

    Raises:
        ValueRuleError: they are not; it names those that only one of them has.
    """
    if apart := sorted(set(names) ^ set(others)):
        raise ValueRuleError(field, apart, "only some of the scores have them; evaluate all of them again")


def pool_scores(scores: Sequence[Scores]) -> Scores:
    """Pool several scenes; tracks of different scenes stay different.

    Raises:
        ValueRuleError: they were measured with different metrics.
    """
    track, offset = [], 0
    for part in scores:
        check_alike("metrics", part.values, scores[0].values)
        _, number = np.unique(part.track, return_inverse=True)
        track.append(number + offset)
        offset += number.max(initial=-1) + 1
    values = {key: np.concatenate([part.values[key] for part in scores]) for key in scores[0].values}
    per_step = {name: np.concatenate([getattr(part, name) for part in scores]) for name in _PER_STEP}
    without_truth = sum(part.without_truth for part in scores)
    noncausal = any(part.noncausal for part in scores)
    return Scores(np.concatenate(track), values, **per_step, without_truth=without_truth, noncausal=noncausal)


def write_scores(scores: Scores, path: Path) -> None:
    """Write the scores of one method in one scene as Parquet, without rounding."""
    columns = {"track": scores.track, **{_METRIC + key: values for key, values in scores.values.items()}}
    columns |= {name: steps for name in _PER_STEP if (steps := getattr(scores, name)).shape[1]}
    write_columns(columns, path, {"without_truth": scores.without_truth, "noncausal": scores.noncausal})


def read_scores(path: Path) -> Scores:
    """Read the scores of one method in one scene.

    Raises:
        InputError: the file cannot be read, or a column is missing; it is named.
    """
    names, about = column_names(path), read_about(path)
    shapes = {name: (-1,) if name in _PER_STEP else () for name in names}
    columns = read_columns(path, {"track": (), "error_m": (-1,), **shapes})
    none = np.zeros((len(columns["track"]), 0))
    values = {name.removeprefix(_METRIC): columns[name] for name in names if name.startswith(_METRIC)}
    error_m, inside, nll = (columns.get(name, none) for name in _PER_STEP)
    with translate_errors(partial(InputError, path, "schema", remedy="Evaluate again")):
        return Scores(columns["track"], values, error_m, inside, nll, **about)
