"""The vocabulary: what was seen (`Recording`), where (`OccupancyMap`), and what is forecast."""

from pedpred.scenes.forecast import Forecast
from pedpred.scenes.occupancy import OccupancyMap
from pedpred.scenes.recording import Recording
from pedpred.scenes.scene import Camera, Scene
from pedpred.scenes.variants import VARIANTS

__all__ = ["VARIANTS", "Camera", "Forecast", "OccupancyMap", "Recording", "Scene"]
