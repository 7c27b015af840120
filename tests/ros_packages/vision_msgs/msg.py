"""Raw messages of the package."""

from wire_types import message_class

Detection3DArray = message_class("vision_msgs", "Detection3DArray")
