"""From per-window scores to the figures of the metric files."""

from __future__ import annotations

from typing import Any

import numpy as np

from pedpred.evaluation.metrics import bootstrap_interval
from pedpred.evaluation.scores import Scores

_DIGITS = 5


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
    }
    return {name: _plain(value) for name, value in values.items()}


def _plain(value: Any) -> Any:
    """JSON numbers, rounded so that a metric file can be read and compared."""
    if isinstance(value, (int, np.integer)):
        return int(value)
    rounded = np.round(np.asarray(value, dtype=np.float64), _DIGITS)
    return rounded.tolist()
