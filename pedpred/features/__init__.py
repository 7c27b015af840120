"""Tracked states, what a model can see around people, and training targets."""

from pedpred.features.contract import ModelFeatures, StoredColumn
from pedpred.features.extract import Steps, clock_steps, extract_at_detections, extract_blocks
from pedpred.features.surroundings import Neighbours, Pedestrians, Surroundings, neighbours_at
from pedpred.features.table import FeatureTable, ForecastProtocol

__all__ = [
    "FeatureTable",
    "ForecastProtocol",
    "ModelFeatures",
    "Neighbours",
    "Pedestrians",
    "Steps",
    "StoredColumn",
    "Surroundings",
    "clock_steps",
    "extract_at_detections",
    "extract_blocks",
    "neighbours_at",
]
