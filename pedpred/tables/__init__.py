"""Detections in text: lines and their fields, titles, units, clocks, ids, rows that are left out."""
