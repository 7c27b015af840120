"""On the robot: detections in, forecasts out, frame by frame; needs no torch."""

from pedpred.online.predictor import OnlinePredictor, OnlineSettings

__all__ = ["OnlinePredictor", "OnlineSettings"]
