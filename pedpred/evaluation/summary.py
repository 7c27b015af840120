"""From per-window scores to the figures of the metric files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pedpred.evaluation.calibration import REGIONS, coverage
from pedpred.evaluation.metrics import bootstrap_interval
from pedpred.evaluation.scores import Scores, pooled

REFERENCE = "kalman_cv"
"""The strongest simple method, which every other is compared with window by window."""

_DIGITS = 5


def figures(
    test: str, scores: Mapping[str, Mapping[str, Scores]], samples: int, seed: int, noncausal: bool
) -> dict[str, dict[str, Any]]:
    """Metric entries of a test set: all its scenes pooled, and each one when there are several.

    Args:
        test: name of the test set.
        scores: scene name -> method -> scores.
        samples: bootstrap replicates.
        seed: of the bootstrap.
        noncausal: the inputs knew the future; every entry says so.
    """
    methods = next(iter(scores.values()))
    pools = {test: {m: pooled([s[m] for s in scores.values()]) for m in methods}}
    if len(scores) > 1:
        pools |= {f"{test}_{name}": dict(own) for name, own in scores.items()}
    mark = {"noncausal": True} if noncausal else {}
    return {
        entry: {m: mark | summary(s, pool[REFERENCE], samples, seed) for m, s in pool.items()}
        for entry, pool in pools.items()
    }


def summary(scores: Scores, reference: Scores, samples: int, seed: int) -> dict[str, Any]:
    """Figures of one forecaster in one scene or pool.

    Args:
        scores: of the forecaster.
        reference: of Kalman constant velocity in the same windows; differences are paired.
        samples: bootstrap replicates.
        seed: of the bootstrap; the same for all methods.
    """
    ade = scores.error_m.mean(axis=1)
    difference = ade - reference.error_m.mean(axis=1)
    quartiles = np.percentile(scores.error_m, [25, 50, 75], axis=0)
    values: dict[str, Any] = {
        "ade_m": ade.mean(),
        "ade_ci95_m": bootstrap_interval(ade, scores.track, samples, np.random.default_rng(seed)),
        "fde_m": scores.error_m[:, -1].mean(),
        "moving_ade_m": ade[scores.moving].mean() if scores.moving.any() else float("nan"),
        "minus_kalman_cv_m": difference.mean(),
        "minus_kalman_cv_ci95_m": bootstrap_interval(
            difference, scores.track, samples, np.random.default_rng(seed)
        ),
        "obstacle_share": scores.in_obstacle.mean(),
        "collision_share": scores.collides.mean(),
        "windows": len(ade),
        "tracks": len(np.unique(scores.track)),
        "per_step_m": scores.error_m.mean(axis=0),
        "per_step_q25_m": quartiles[0],
        "per_step_q50_m": quartiles[1],
        "per_step_q75_m": quartiles[2],
        **_calibration(scores),
    }
    return {name: _plain(value) for name, value in values.items()}


def _calibration(scores: Scores) -> dict[str, Any]:
    """What the truth says of a method's own covariances; nothing of a method that tells none."""
    if not scores.nll.shape[1]:
        return {}
    covered = {f"per_step_coverage_{100 * share:.0f}": coverage(scores.distance2, share) for share in REGIONS}
    return {"nll": scores.nll.mean(), "per_step_nll": scores.nll.mean(axis=0), **covered}


def _plain(value: Any) -> Any:
    """JSON numbers, rounded so that a metric file can be read and compared."""
    if isinstance(value, (int, np.integer)):
        return int(value)
    rounded = np.round(np.asarray(value, dtype=np.float64), _DIGITS)
    return rounded.tolist()
