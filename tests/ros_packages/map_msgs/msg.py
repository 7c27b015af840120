"""Raw messages of the package."""

from wire_types import message_class

OccupancyGridUpdate = message_class("map_msgs", "OccupancyGridUpdate")
