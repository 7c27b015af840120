"""Windows, metrics and their uncertainty."""

from pedpred.evaluation.scores import Scores, pooled, score
from pedpred.evaluation.summary import summary

__all__ = ["Scores", "pooled", "score", "summary"]
