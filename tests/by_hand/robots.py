"""Robots with unequal limits, of both kinds."""

from pedpred.driving.robot import Robot

LIMITS = {
    "radius_m": 0.35,
    "speed_mps": 1.1,
    "turn_radps": 1.7,
    "acceleration_mps2": 0.9,
    "braking_mps2": 1.6,
    "turn_acceleration_radps2": 2.3,
}
ROBOT, HOLONOMIC = Robot("differential", **LIMITS), Robot("holonomic", **LIMITS)
