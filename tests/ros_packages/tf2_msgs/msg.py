"""Raw messages of the package."""

from wire_types import message_class

TFMessage = message_class("tf2_msgs", "TFMessage")
