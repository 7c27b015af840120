"""Forecasters without training; `registry.py` lists them."""
