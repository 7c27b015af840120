"""Scenes, feature shards and checkpoints on disk."""
