"""Value types: trajectories, occupancy maps, scenes and forecasts."""

from pedpred.scenes.occupancy import OccupancyMap
from pedpred.scenes.placement import Placement, checked_placement, placement
from pedpred.scenes.predicted import BODY_M, predicted_occupancy
from pedpred.scenes.predictions import Forecast, Predictions
from pedpred.scenes.scene import Camera, Scene, Trajectories, rule_of
from pedpred.scenes.variants import VARIANTS

__all__ = [
    "BODY_M",
    "VARIANTS",
    "Camera",
    "Forecast",
    "OccupancyMap",
    "Placement",
    "Predictions",
    "Scene",
    "Trajectories",
    "checked_placement",
    "placement",
    "predicted_occupancy",
    "rule_of",
]
