"""Metrics of forecasts: one table, and the functions behind it."""

from pedpred.metrics.table import METRICS, Metric, MetricScene

__all__ = ["METRICS", "Metric", "MetricScene"]
