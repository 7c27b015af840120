"""Rows for training: sampled from simulated and recorded people, and kept on disk."""
