"""What a subscription says of events of the middleware: nothing. Needs rclpy."""

from __future__ import annotations

from importlib import import_module
from typing import Any

_MODULES = "rclpy.event_handler", "rclpy.qos_event"
"""Where rclpy has callbacks of events: from Iron on, and in Humble."""


def no_callbacks() -> Any:
    """Callbacks of a subscription that say nothing, also not that the QoS of a publisher does not fit.

    Raises:
        ImportError: this rclpy has none.
    """
    problem = ImportError("rclpy has no module of events")
    for name in _MODULES:
        try:
            return import_module(name).SubscriptionEventCallbacks(use_default_callbacks=False)
        except ImportError as cause:
            problem = cause
    raise problem
