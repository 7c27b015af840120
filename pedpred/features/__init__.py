"""Network inputs (occupancy crop, angular pedestrian grid, velocity) and training targets."""

from pedpred.features.angular import angular_grids
from pedpred.features.bits import unpack_crops
from pedpred.features.crop import occupancy_crops
from pedpred.features.extract import extract, extract_at_detections, extract_blocks
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
