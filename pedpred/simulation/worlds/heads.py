"""Where the heads of people are: bodies sway as they step. Sensors see heads, and heads are forecast."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy.ndimage import uniform_filter1d

from pedpred.scenes import Scene, Trajectories
from pedpred.settings import In, Settings

_SPEED_ROWS, _DIRECTION_ROWS = 11, 15  # of the moving means
_ALONG = 0.4  # amplitude along the way, at twice the frequency, as a share of the lateral one
_DRIFT_S = 1.5


@dataclass(frozen=True)
class Sway(Settings):
    """Movement of heads relative to the simulated positions.

    Attributes:
        amplitude_m: mean lateral amplitude at 0.75 m/s; it falls with the speed.
        tempo: factor on how much the step frequency rises with the speed.
        drift_m: standard deviation of a slowly changing offset, such as clicking errors.
    """

    amplitude_m: Annotated[float, In("[0, 1000]")] = 0.0
    tempo: Annotated[float, In("[0, 1000]")] = 1.0
    drift_m: Annotated[float, In("[0, 1000]")] = 0.0


def move_to_heads(scene: Scene, sway: Sway, rng: np.random.Generator) -> Scene:
    """Move true positions to the heads; velocities are dropped, goals and groups stay.

    A person of speed v (mean over 1.1 s) has its head at A sin(phi) beside and 0.4 A sin(2 phi + 1) ahead
    of the position, with A = amplitude_m B (1.6 - 0.8 min(v, 1.5)) min(1, 0.3 + v / 0.15), personal B
    (log-normal, 0.3) and d phi / dt = 2 pi (0.35 + 0.42 tempo min(v, 1.6)) / s.

    Args:
        scene: positions and velocities at equal steps of `detection_dt_s`.
        sway: amplitudes.
        rng: source of all randomness.
    """
    trajectories = scene.trajectories
    assert trajectories.velocity is not None
    position = trajectories.position.copy()
    for rows in trajectories.by_track():
        position[rows] += _offsets(trajectories.velocity[rows], sway, scene.detection_dt_s, rng)
    heads = Trajectories(
        trajectories.time_s,
        trajectories.track_id,
        position,
        goal=trajectories.goal,
        desired_speed_mps=trajectories.desired_speed_mps,
        group_id=trajectories.group_id,
    )
    return replace(scene, trajectories=heads)


def _offsets(velocity: np.ndarray, sway: Sway, dt_s: float, rng: np.random.Generator) -> np.ndarray:
    """Offset of one person's head over time, m. [T, 2]."""
    from scipy.signal import lfilter  # late: takes longer to import than all else here

    speed = uniform_filter1d(np.linalg.norm(velocity, axis=1), _SPEED_ROWS, mode="nearest")
    direction = uniform_filter1d(velocity, _DIRECTION_ROWS, axis=0, mode="nearest")
    direction /= np.linalg.norm(direction, axis=1, keepdims=True) + 0.05
    amplitude = sway.amplitude_m * math.exp(rng.normal(0.0, 0.3)) * (1.6 - 0.8 * np.minimum(speed, 1.5))
    amplitude *= np.minimum(1.0, 0.3 + speed / 0.15)
    frequency_hz = 0.35 + 0.42 * sway.tempo * np.minimum(speed, 1.6)
    phase = rng.uniform(0.0, 2 * np.pi) + 2 * np.pi * dt_s * np.cumsum(frequency_hz)
    beside = np.stack([-direction[:, 1], direction[:, 0]], axis=1)
    offset = beside * (amplitude * np.sin(phase))[:, None]
    offset += direction * (_ALONG * amplitude * np.sin(2 * phase + 1.0))[:, None]
    keeps = math.exp(-dt_s / _DRIFT_S)
    fresh, before = rng.normal(0.0, 1.0, velocity.shape), rng.normal(0.0, 1.0, (1, 2))
    drift, _ = lfilter([math.sqrt(1 - keeps**2)], [1.0, -keeps], fresh, axis=0, zi=keeps * before)
    return offset + sway.drift_m * np.asarray(drift)
