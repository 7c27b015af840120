"""ROS formats: MCAP recordings <-> scenes and forecasts; bags of ROS 1 and ROS 2 -> scenes.

Positions are in the world frame, called `map` (its parent `world` coincides with it); times are the scene's.
The names below are imported on first use: a robot's node needs no libraries that read files.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

_HOMES = {
    "ADAPTERS": "people",
    "TrackNumbers": "people",
    "Transform": "frames",
    "check_recordable": "recordings",
    "find_usable": "people",
    "is_bag": "bag_files",
    "is_recording": "recordings",
    "map_of_grid": "scene_messages",
    "read_bag": "bags",
    "read_recording": "recordings",
    "seconds": "scene_messages",
    "write_recording": "recordings",
}


def __getattr__(name: str) -> Any:
    """Import a public name from the module that defines it."""
    if name not in _HOMES:
        raise AttributeError(f"module 'pedpred.ros' has no attribute {name!r}")
    return getattr(import_module(f"pedpred.ros.{_HOMES[name]}"), name)
