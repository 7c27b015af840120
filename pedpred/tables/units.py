"""Units of length."""

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Units of length by their names in files, m."""
