"""The sensors that look at worlds: ranges of their faults, of how heads sway, and of what is seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple

import numpy as np

from pedpred.scenes import Scene
from pedpred.settings import In, Range, Settings
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.simulation.worlds.drawing import log_uniform, uniform
from pedpred.simulation.worlds.floors import Area
from pedpred.simulation.worlds.heads import Sway, move_to_heads
from pedpred.simulation.worlds.views import ViewSettings, parse_views


@dataclass(frozen=True)
class SensingSettings(Settings):
    """Ranges of the faults. A fault with a share occurs in this share of the worlds.

    Attributes:
        rates_hz: detections per second; one is drawn, repeated ones more often.
        noise_m: standard deviation of a coordinate; log-uniform.
        noisy_share: the others have the least noise.
        jitter_s: largest shift of an instant.
        jitter_share: of the worlds.
        quantum_m: coordinates are rounded to multiples of this.
        quantum_share: of the worlds.
        drop_out: share of missing detections.
        drop_out_share: of the worlds.
        late_s: longest time until somebody is detected first.
        late_share: of the worlds.
        switch: probability at each instant that two people within 0.8 m swap ids; log-uniform.
        switch_share: of the worlds.
        sway_m: amplitude of heads.
        sway_share: of the worlds.
        tempo: see `Sway`.
        drift_m: slow error of the truth.
        drift_share: of the worlds.
        views: what is seen of each kind of world.
    """

    rates_hz: Annotated[tuple[float, ...], In("(0, 100]")]
    noise_m: Annotated[Range, In("(0, 1000]")]
    noisy_share: Annotated[float, In("[0, 1]")]
    jitter_s: Annotated[Range, In("[0, 1000]")]
    jitter_share: Annotated[float, In("[0, 1]")]
    quantum_m: Annotated[Range, In("(0, 1000]")]
    quantum_share: Annotated[float, In("[0, 1]")]
    drop_out: Annotated[Range, In("[0, 1)")]
    drop_out_share: Annotated[float, In("[0, 1]")]
    late_s: Annotated[Range, In("[0, 1000]")]
    late_share: Annotated[float, In("[0, 1]")]
    switch: Annotated[Range, In("(0, 1]")]
    switch_share: Annotated[float, In("[0, 1]")]
    sway_m: Annotated[Range, In("[0, 1000]")]
    sway_share: Annotated[float, In("[0, 1]")]
    tempo: Annotated[Range, In("[0, 1000]")]
    drift_m: Annotated[Range, In("[0, 1000]")]
    drift_share: Annotated[float, In("[0, 1]")]
    views: Mapping[str, ViewSettings] = field(metadata={"parse": parse_views})


class SensedWorld(NamedTuple):
    """What a sensor makes of a world.

    Attributes:
        detections: inside the view; `person_id` is the identity in `heads`.
        heads: the truth: positions of the heads every 0.1 s, everywhere.
    """

    detections: Scene
    heads: Scene


def sense_world(scene: Scene, view: Area, settings: SensingSettings, rng: np.random.Generator) -> SensedWorld:
    """Draw a sensor and look at a world.

    Args:
        scene: of `simulate_world`.
        view: what the sensor sees.
        settings: ranges of the faults.
        rng: source of all randomness; derive it from (seed, scene).
    """
    sensor, sway = draw_sensor(settings, rng)
    heads = move_to_heads(scene, sway, rng)
    return SensedWorld(apply_sensor(heads, sensor, rng, view.holds), heads)


def draw_sensor(settings: SensingSettings, rng: np.random.Generator) -> tuple[SensorSettings, Sway]:
    """Draw the faults of a sensor, and how heads move in its world."""

    def sometimes(share: float, limits: Range, draw: Any = uniform) -> float:
        return draw(rng, limits) if rng.random() < share else 0.0

    quiet = rng.random() >= settings.noisy_share
    sensor = SensorSettings(
        own_clock=True,
        rate_hz=float(rng.choice(settings.rates_hz)),
        position_noise_m=settings.noise_m[0] if quiet else log_uniform(rng, settings.noise_m),
        jitter_s=sometimes(settings.jitter_share, settings.jitter_s),
        quantum_m=sometimes(settings.quantum_share, settings.quantum_m),
        drop_out_share=sometimes(settings.drop_out_share, settings.drop_out),
        late_s=sometimes(settings.late_share, settings.late_s),
        switch_share=sometimes(settings.switch_share, settings.switch, log_uniform),
    )
    amplitude_m = sometimes(settings.sway_share, settings.sway_m)
    drift_m = sometimes(settings.drift_share, settings.drift_m)
    return sensor, Sway(amplitude_m, uniform(rng, settings.tempo), drift_m)
