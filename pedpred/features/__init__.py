"""Tracked states, what a model can see around people, and training targets."""

from pedpred.features.contract import ModelFeatures, StoredColumn
from pedpred.features.extract import extract, extract_at_detections, extract_blocks
from pedpred.features.surroundings import Neighbours, Pedestrians, Surroundings, neighbours_at
from pedpred.features.table import FeatureTable, ForecastProtocol

__all__ = [
    "FeatureTable",
    "ForecastProtocol",
    "ModelFeatures",
    "Neighbours",
    "Pedestrians",
    "StoredColumn",
    "Surroundings",
    "extract",
    "extract_at_detections",
    "extract_blocks",
    "neighbours_at",
]
