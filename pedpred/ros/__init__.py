"""ROS formats: MCAP recordings <-> scenes and forecasts; bags of ROS 1 and ROS 2 -> scenes.

World frame everywhere, called `map` (its parent `world` coincides with it); times are the scene's.
"""

from pedpred.ros.bags import is_bag, read_bag
from pedpred.ros.reader import read_recording
from pedpred.ros.tracked_people import ADAPTERS, Names, seconds
from pedpred.ros.writer import write_recording

__all__ = ["ADAPTERS", "Names", "is_bag", "read_bag", "read_recording", "seconds", "write_recording"]
