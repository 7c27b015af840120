"""Splits and lanes: how feature tables become training batches."""

from pedpred.datasets.lanes import LaneBatch, split_sequences, stream_lanes
from pedpred.datasets.motion import MotionData, load_motion_data

__all__ = ["LaneBatch", "MotionData", "load_motion_data", "split_sequences", "stream_lanes"]
