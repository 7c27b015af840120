"""Detections in text: what columns are called, units, clocks, ids, rows that are left out."""
