"""`ros2 run pedpred_ros pedpred`."""

from pedpred.ros2.main import main

__all__ = ["main"]
