"""Value types: trajectories, occupancy maps, scenes and forecasts."""

from pedpred.scenes.predictions import Forecast, Predictions
from pedpred.scenes.scene import Camera, OccupancyMap, Scene, Trajectories
from pedpred.scenes.variants import VARIANTS

__all__ = ["VARIANTS", "Camera", "Forecast", "OccupancyMap", "Predictions", "Scene", "Trajectories"]
