"""Windows, metrics and their uncertainty."""

from pedpred.evaluation.scores import EvaluationSettings, Scores, compare, pooled, score
from pedpred.evaluation.summary import summaries, summary

__all__ = ["EvaluationSettings", "Scores", "compare", "pooled", "score", "summaries", "summary"]
