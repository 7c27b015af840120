"""Value types: trajectories, occupancy maps, scenes and forecasts."""

from pedpred.scenes.placement import Placement, checked_placement
from pedpred.scenes.predictions import Forecast, Predictions
from pedpred.scenes.scene import Camera, OccupancyMap, Scene, Trajectories
from pedpred.scenes.variants import VARIANTS

__all__ = [
    "VARIANTS",
    "Camera",
    "Forecast",
    "OccupancyMap",
    "Placement",
    "Predictions",
    "Scene",
    "Trajectories",
    "checked_placement",
]
