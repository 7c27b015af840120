"""Raw messages of the package."""

from wire_types import message_class

AgentStates = message_class("pedsim_msgs", "AgentStates")
