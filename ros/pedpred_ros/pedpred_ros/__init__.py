"""Starts the node of pedpred under the name of a ROS package."""
