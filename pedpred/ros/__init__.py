"""ROS formats: MCAP recordings <-> scenes and forecasts; bags of ROS 1 and ROS 2 -> scenes.

Positions are in the world frame, called `map` (its parent `world` coincides with it); times are the scene's.
"""

from pedpred.ros.bag_files import is_bag
from pedpred.ros.bags import read_bag
from pedpred.ros.frames import Transform
from pedpred.ros.people import ADAPTERS, TrackNumbers, find_usable
from pedpred.ros.recordings import check_recordable, is_recording, read_recording, write_recording
from pedpred.ros.scene_messages import map_of_grid, seconds

__all__ = [
    "ADAPTERS",
    "TrackNumbers",
    "Transform",
    "check_recordable",
    "find_usable",
    "is_bag",
    "is_recording",
    "map_of_grid",
    "read_bag",
    "read_recording",
    "seconds",
    "write_recording",
]
