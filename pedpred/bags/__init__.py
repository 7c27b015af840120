"""Recordings of robots: ROS bags -> scenes, and what the usual messages of tracked people say."""

from pedpred.bags.people import ADAPTERS, Names, seconds
from pedpred.bags.reader import is_bag, read_bag

__all__ = ["ADAPTERS", "Names", "is_bag", "read_bag", "seconds"]
