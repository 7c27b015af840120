"""Network inputs (occupancy crop, angular pedestrian grid, velocity) and training targets."""

from pedpred.features.extract import extract, extract_at_detections, extract_blocks
from pedpred.features.grids import angular_grids, occupancy_crops, unpack_crops
from pedpred.features.observe import Neighbours, Observation, Pedestrians, observe
from pedpred.features.table import FeatureSettings, FeatureTable

__all__ = [
    "FeatureSettings",
    "FeatureTable",
    "Neighbours",
    "Observation",
    "Pedestrians",
    "angular_grids",
    "extract",
    "extract_at_detections",
    "extract_blocks",
    "observe",
    "occupancy_crops",
    "unpack_crops",
]
