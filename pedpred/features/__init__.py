"""What the network sees: occupancy crop, angular pedestrian grid, velocity; and what it is taught."""

from pedpred.features.angular import angular_grids
from pedpred.features.bits import unpack_crops
from pedpred.features.crop import occupancy_crops
from pedpred.features.extract import extract, extract_at_detections, extract_blocks
from pedpred.features.observe import Observation, Pedestrians, observe_frame
from pedpred.features.presence import frame_at
from pedpred.features.table import FeatureSettings, FeatureTable

__all__ = [
    "FeatureSettings",
    "FeatureTable",
    "Observation",
    "Pedestrians",
    "angular_grids",
    "extract",
    "extract_at_detections",
    "extract_blocks",
    "frame_at",
    "observe_frame",
    "occupancy_crops",
    "unpack_crops",
]
