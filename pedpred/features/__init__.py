"""What the network sees: occupancy crop, angular pedestrian grid, velocity; and what it is taught."""

from pedpred.features.angular import angular_grids
from pedpred.features.bits import unpack_crops
from pedpred.features.crop import occupancy_crops
from pedpred.features.extract import extract
from pedpred.features.table import FeatureSettings, FeatureTable

__all__ = [
    "FeatureSettings",
    "FeatureTable",
    "angular_grids",
    "extract",
    "occupancy_crops",
    "unpack_crops",
]
