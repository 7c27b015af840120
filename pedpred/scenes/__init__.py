"""Value types: trajectories, occupancy maps, scenes and forecasts."""

from pedpred.scenes.forecast import Forecast
from pedpred.scenes.occupancy import OccupancyMap
from pedpred.scenes.predictions import Predictions
from pedpred.scenes.scene import Camera, Scene
from pedpred.scenes.trajectories import Trajectories
from pedpred.scenes.variants import VARIANTS

__all__ = ["VARIANTS", "Camera", "Forecast", "OccupancyMap", "Predictions", "Scene", "Trajectories"]
