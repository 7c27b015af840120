"""People far from each other, on free ground: they walk straight or meander, halt and go on, or stand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.settings import In, Range, Settings

_FAR_M = 1000.0  # between two people
_SPEED_S = 3.0  # correlation time of the speed
_PACE = (0.3, 1.3)  # least and largest speed of somebody who walks, as a share of the desired one


@dataclass(frozen=True)
class LoneSettings(Settings):
    """Ranges of people far from each other; each person draws from them.

    Attributes:
        duration_s: recorded time.
        people: their number.
        standing_share: share of those who stand.
        speed_mps: of the others; log-uniform, since slow people are the hardest to tell from standing ones.
        straight_share: share of those who walk exactly straight, at one speed.
        turn_radps: standard deviation of the turn rate of the others; log-uniform.
        turn_s: its correlation time.
        unsteady: standard deviation of their speed over time, as a share; log-uniform.
        halting_share: share of those who meander that halt now and then.
        halt_rate_hz: halts per second of walking; log-uniform.
        halt_s: mean length of a halt; log-uniform.
        relaxation_s: in which a speed is reached; log-uniform.
    """

    duration_s: Annotated[float, In("(0, 36000]")]
    people: Annotated[int, In("[1, 1000]")]
    standing_share: Annotated[float, In("[0, 1]")]
    speed_mps: Annotated[Range, In("(0, 1000]")]
    straight_share: Annotated[float, In("[0, 1]")]
    turn_radps: Annotated[Range, In("(0, 10]")]
    turn_s: Annotated[Range, In("[0.1, 100]")]
    unsteady: Annotated[Range, In("(0, 0.5]")]
    halting_share: Annotated[float, In("[0, 1]")]
    halt_rate_hz: Annotated[Range, In("(0, 10]")]
    halt_s: Annotated[Range, In("(0, 36000]")]
    relaxation_s: Annotated[Range, In("[0.1, 100]")]


def simulate_lone_people(
    settings: LoneSettings, record_s: float, name: str, rng: np.random.Generator
) -> Scene:
    """Simulate people far from each other.

    With turn rate and speed as Ornstein-Uhlenbeck processes x_k of unit variance,
        d theta / dt = turn_radps x_1,    d v / dt = (w speed (1 + unsteady x_2) - v) / relaxation_s
    where w is 0 during a halt and 1 otherwise.
    """
    count, records = settings.people, round(settings.duration_s / record_s)

    def each(limits: Range) -> np.ndarray:
        return np.exp(rng.uniform(math.log(limits[0]), math.log(limits[1]), count))

    stands = rng.random(count) < settings.standing_share
    speed = each(settings.speed_mps) * ~stands
    meanders = rng.random(count) >= settings.straight_share
    turn_radps, unsteady = each(settings.turn_radps) * meanders, each(settings.unsteady) * meanders
    halts = meanders & (rng.random(count) < settings.halting_share)
    halt_hz, halt_s = each(settings.halt_rate_hz) * halts, each(settings.halt_s)
    relaxation_s = each(settings.relaxation_s)
    correlation_s = np.stack([rng.uniform(*settings.turn_s, count), np.full(count, _SPEED_S)])

    angle = rng.uniform(0.0, 2 * np.pi, count)
    process = rng.standard_normal((2, count))
    walks = rng.random(count) < 1.0 / (1.0 + halt_hz * halt_s)
    now = speed * walks
    velocity = np.empty((records, count, 2))
    for k in range(records):
        velocity[k] = now[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        angle = angle + turn_radps * process[0] * record_s
        wanted = walks * speed * np.clip(1.0 + unsteady * process[1], *_PACE)
        now = wanted + (now - wanted) * np.exp(-record_s / relaxation_s)
        keeps = np.exp(-record_s / correlation_s)
        process = keeps * process + np.sqrt(1 - keeps**2) * rng.standard_normal((2, count))
        change = np.where(walks, halt_hz, 1.0 / halt_s)
        walks = walks ^ (rng.random(count) < 1.0 - np.exp(-record_s * change))
    steps = (velocity[1:] + velocity[:-1]) / 2 * record_s
    start = np.stack([np.arange(count) * _FAR_M, np.zeros(count)], axis=1)
    position = start + np.concatenate([np.zeros((1, count, 2)), np.cumsum(steps, axis=0)])
    trajectories = Trajectories(
        time_s=np.round(np.repeat(np.arange(records) * record_s, count), 9),
        track_id=np.tile(np.arange(count), records),
        position=position.reshape(-1, 2),
        velocity=velocity.reshape(-1, 2),
        desired_speed_mps=np.tile(speed, records),
    )
    nothing = OccupancyMap(np.zeros((1, 1), bool), np.zeros(2), 1.0)
    return Scene(name, trajectories, nothing, record_s)
