"""Raw messages of the package."""

from wire_types import message_class

People = message_class("people_msgs", "People")
