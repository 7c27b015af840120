"""A network without memory: several weighted paths from recent motion, neighbours and ray casts."""
