"""Forecasters without training, and the table of all forecasters."""
