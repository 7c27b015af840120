"""Forecasters without training, and the table of them."""

from pedpred.baselines.registry import BASELINES, PRESENT_MOTION, baselines

__all__ = ["BASELINES", "PRESENT_MOTION", "baselines"]
