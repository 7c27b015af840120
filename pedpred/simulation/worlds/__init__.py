"""Simulated worlds of many kinds, and the sensors that look at them."""

from pedpred.simulation.worlds.floors import Area
from pedpred.simulation.worlds.sensing import SensedWorld, SensingSettings, draw_sensor, sense_world
from pedpred.simulation.worlds.settings import WorldSettings
from pedpred.simulation.worlds.views import draw_view
from pedpred.simulation.worlds.world import DRAWN_KINDS, KINDS, simulate_world

__all__ = [
    "DRAWN_KINDS",
    "KINDS",
    "Area",
    "SensedWorld",
    "SensingSettings",
    "WorldSettings",
    "draw_sensor",
    "draw_view",
    "sense_world",
    "simulate_world",
]
