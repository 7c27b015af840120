"""Windows, metrics and their uncertainty."""

from pedpred.evaluation.scores import EvaluationSettings, Scores, pooled, score
from pedpred.evaluation.summary import summaries

__all__ = ["EvaluationSettings", "Scores", "pooled", "score", "summaries"]
