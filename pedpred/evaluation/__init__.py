"""Windows, metrics and their uncertainty."""

from pedpred.evaluation.scores import (
    EvaluationSettings,
    MetricSettings,
    Resampling,
    Scores,
    pool_scores,
    score,
)
from pedpred.evaluation.summary import summarise_methods

__all__ = [
    "EvaluationSettings",
    "MetricSettings",
    "Resampling",
    "Scores",
    "pool_scores",
    "score",
    "summarise_methods",
]
