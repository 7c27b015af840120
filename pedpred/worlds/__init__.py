"""Simulated worlds of many kinds, and the sensors that look at them: training data for small situations."""

from pedpred.worlds.floors import Area
from pedpred.worlds.sensing import SensedWorld, SensingSettings, Sensor, drawn_sensor, sense, sense_world
from pedpred.worlds.settings import KINDS, WorldSettings
from pedpred.worlds.views import drawn_view
from pedpred.worlds.world import simulate_world

__all__ = [
    "KINDS",
    "Area",
    "SensedWorld",
    "SensingSettings",
    "Sensor",
    "WorldSettings",
    "drawn_sensor",
    "drawn_view",
    "sense",
    "sense_world",
    "simulate_world",
]
