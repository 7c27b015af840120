"""Windows, metrics and their uncertainty."""

from pedpred.evaluation.scores import EvaluationSettings, MetricSettings, Resampling, Scores, pooled, score
from pedpred.evaluation.summary import summaries

__all__ = ["EvaluationSettings", "MetricSettings", "Resampling", "Scores", "pooled", "score", "summaries"]
