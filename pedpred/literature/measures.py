"""What is measured in the windows of the literature, in the terms of its tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pedpred.evaluation.scores import MetricSettings, Scores, describe_scene, score
from pedpred.forecasting import Forecaster
from pedpred.literature.samples import covering_paths
from pedpred.literature.windows import WindowSet
from pedpred.metrics import METRICS

BEST_ADE, BEST_FDE = "best_ade_m", "best_fde_m"
"""Errors of the nearest of the samples, each with its own nearest one; NaN for a method with one path
and no covariances.

The samples are those of `covering_paths`, or all modes of a method that gives no covariances.
"""


def measure(windows: WindowSet, forecaster: Forecaster, samples: int, settings: MetricSettings) -> Scores:
    """Measure a forecaster in all windows of a recording.

    Args:
        windows: of the recording.
        forecaster: of any method.
        samples: number of paths of which the best one counts.
        settings: thresholds of the metrics.
    """
    request = windows.request
    predictions = forecaster(request)
    scene = describe_scene(request.asked, request.scene.occupancy, settings)
    scores = score(predictions, windows.truth, windows.track, scene, METRICS)
    best = np.full((2, len(windows.track)), np.nan)
    spread = predictions.covariance is not None
    if spread or predictions.modes > 1:
        paths = covering_paths(predictions, samples) if spread else predictions.path[:, :samples]
        away_m = np.linalg.norm(paths - windows.truth[:, None], axis=-1)
        best = np.stack([away_m.mean(axis=2).min(axis=1), away_m[..., -1].min(axis=1)])
    return replace(scores, values={**scores.values, BEST_ADE: best[0], BEST_FDE: best[1]})


def mean_scores(scores: Sequence[Scores]) -> Scores:
    """The mean over networks that differ in their seed alone, window by window; without shares in regions.

    Whether a region holds the truth is a question to each network: a mean share answers it for none.
    """
    first = scores[0]
    values = {key: np.mean([each.values[key] for each in scores], axis=0) for key in first.values}
    steps = {n: np.mean([getattr(each, n) for each in scores], axis=0) for n in ("error_m", "nll")}
    return replace(first, values=values, inside=first.inside[:, :0], **steps)
