"""On the robot: detections in, forecasts out, frame by frame; needs no torch."""

from pedpred.online.predictor import OnlinePredictor
from pedpred.online.settings import OnlineSettings

__all__ = ["OnlinePredictor", "OnlineSettings"]
