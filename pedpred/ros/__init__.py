"""ROS formats: scenes and forecasts -> MCAP recordings; bags of ROS 1 and ROS 2 -> scenes.

Positions are in the world frame, called `map` (its parent `world` coincides with it); times are the scene's.
The names below are imported on first use: a robot's node needs no libraries that read files.
"""

from typing import TYPE_CHECKING

from pedpred.lazy import names_on_use

if TYPE_CHECKING:
    from pedpred.ros.bag_files import is_bag as is_bag
    from pedpred.ros.bags import read_bag as read_bag
    from pedpred.ros.frames import Transform as Transform
    from pedpred.ros.people import PEOPLE_FIELDS as PEOPLE_FIELDS
    from pedpred.ros.recordings import check_recordable as check_recordable
    from pedpred.ros.recordings import write_recording as write_recording
    from pedpred.ros.scene_messages import map_of_grid as map_of_grid
else:
    __all__, __getattr__ = names_on_use(
        __name__,
        {
            "is_bag": "pedpred.ros.bag_files",
            "read_bag": "pedpred.ros.bags",
            "Transform": "pedpred.ros.frames",
            "PEOPLE_FIELDS": "pedpred.ros.people",
            "check_recordable": "pedpred.ros.recordings",
            "write_recording": "pedpred.ros.recordings",
            "map_of_grid": "pedpred.ros.scene_messages",
        },
    )
