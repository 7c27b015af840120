"""Windows, scores and their uncertainty."""

from pedpred.evaluation.measure import given, measure
from pedpred.evaluation.scores import (
    EvaluationSettings,
    MetricSettings,
    Resampling,
    Scores,
    pool_scores,
    score,
)
from pedpred.evaluation.summary import summarise_methods
from pedpred.evaluation.windows import WindowSet, find_windows

__all__ = [
    "EvaluationSettings",
    "MetricSettings",
    "Resampling",
    "Scores",
    "WindowSet",
    "find_windows",
    "given",
    "measure",
    "pool_scores",
    "score",
    "summarise_methods",
]
