"""Scenes and forecasts <-> recordings that robotics viewers open: MCAP with ROS 2 messages.

World frame everywhere, called `map` (its parent `world` coincides with it); times are the scene's.
"""

from pedpred.recording.reader import read_recording
from pedpred.recording.writer import write_recording

__all__ = ["read_recording", "write_recording"]
