"""Sensors with drawn faults that look at a world from somewhere: rates, noise, lost and swapped people."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from pedpred.scenes import Scene, Trajectories
from pedpred.simulation.fields import Range
from pedpred.simulation.sensor import measured
from pedpred.worlds.drawing import check_intervals, log_uniform, uniform
from pedpred.worlds.floors import Area
from pedpred.worlds.heads import Sway, heads_of
from pedpred.worlds.views import ViewSettings, parsed_views, usual_views

_SWITCH_RANGE_M = 0.8
_USUAL_RATES_HZ = (2.0, 2.5, 2.5, 2.67, 2.67, 3.33, 4.0, 5.0, 8.0, 10.0, 15.0)


@dataclass(frozen=True)
class SensingSettings:
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
        views: what is seen of each kind of world, and of simulated scenes of another origin.
    """

    rates_hz: tuple[float, ...] = _USUAL_RATES_HZ
    noise_m: Range = (0.005, 0.1)
    noisy_share: float = 0.8
    jitter_s: Range = (0.0, 0.03)
    jitter_share: float = 0.5
    quantum_m: Range = (0.02, 0.08)
    quantum_share: float = 0.3
    drop_out: Range = (0.0, 0.12)
    drop_out_share: float = 0.5
    late_s: Range = (0.0, 3.0)
    late_share: float = 0.5
    switch: Range = (0.0005, 0.01)
    switch_share: float = 0.4
    sway_m: Range = (0.01, 0.08)
    sway_share: float = 0.85
    tempo: Range = (0.7, 1.1)
    drift_m: Range = (0.005, 0.03)
    drift_share: float = 0.65
    views: Mapping[str, ViewSettings] = field(default_factory=usual_views, metadata={"parse": parsed_views})

    def __post_init__(self) -> None:
        check_intervals(self, {"(0, 100]": "rates_hz"})
        check_intervals(self, {"[0, 1000]": "jitter_s late_s sway_m tempo drift_m", "[0, 1)": "drop_out"})
        check_intervals(self, {"(0, 1000]": "noise_m quantum_m", "(0, 1]": "switch"})


@dataclass(frozen=True)
class Sensor:
    """Faults of one sensor; the defaults are a perfect one.

    Attributes:
        rate_hz: detections per second.
        noise_m: standard deviation of a coordinate.
        jitter_s: largest shift of an instant.
        quantum_m: coordinates are rounded to multiples of this; 0: not at all.
        drop_out: share of missing detections.
        late_s: longest time until somebody is detected first.
        switch: probability at each instant that two people within 0.8 m swap ids, permanently.
    """

    rate_hz: float = 10.0
    noise_m: float = 0.0
    jitter_s: float = 0.0
    quantum_m: float = 0.0
    drop_out: float = 0.0
    late_s: float = 0.0
    switch: float = 0.0

    def __post_init__(self) -> None:
        check_intervals(self, {"(0, 1000]": "rate_hz", "[0, 1000]": "noise_m jitter_s quantum_m late_s"})
        check_intervals(self, {"[0, 1)": "drop_out", "[0, 1]": "switch"})


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
    sensor, sway = drawn_sensor(settings, rng)
    heads = heads_of(scene, sway, rng)
    return SensedWorld(sense(heads, sensor, view, rng), heads)


def drawn_sensor(settings: SensingSettings, rng: np.random.Generator) -> tuple[Sensor, Sway]:
    """Draw the faults of a sensor, and how heads move in its world."""

    def sometimes(share: float, limits: Range, draw: Any = uniform) -> float:
        return draw(rng, limits) if rng.random() < share else 0.0

    quiet = rng.random() >= settings.noisy_share
    sensor = Sensor(
        rate_hz=float(rng.choice(settings.rates_hz)),
        noise_m=settings.noise_m[0] if quiet else log_uniform(rng, settings.noise_m),
        jitter_s=sometimes(settings.jitter_share, settings.jitter_s),
        quantum_m=sometimes(settings.quantum_share, settings.quantum_m),
        drop_out=sometimes(settings.drop_out_share, settings.drop_out),
        late_s=sometimes(settings.late_share, settings.late_s),
        switch=sometimes(settings.switch_share, settings.switch, log_uniform),
    )
    amplitude_m = sometimes(settings.sway_share, settings.sway_m)
    drift_m = sometimes(settings.drift_share, settings.drift_m)
    return sensor, Sway(amplitude_m, uniform(rng, settings.tempo), drift_m)


def sense(scene: Scene, sensor: Sensor, view: Area, rng: np.random.Generator) -> Scene:
    """Replace true positions by the detections of a sensor; `person_id` keeps the true identity.

    The sensor detects everybody in view at the same instants; between recorded positions they walk straight.

    Args:
        scene: positions at short equal steps; each track without gaps.
        sensor: its faults.
        view: what it sees.
        rng: source of all randomness.
    """
    truth, interval_s = scene.trajectories, 1.0 / sensor.rate_hz
    end_s = float(truth.time_s.max(initial=0.0))
    instants = np.arange(rng.uniform(0.0, interval_s), end_s, interval_s)
    instants += rng.uniform(-sensor.jitter_s, sensor.jitter_s, len(instants))
    instants = np.unique(np.clip(instants, 0.0, end_s))
    order = np.lexsort((truth.time_s, truth.track_id))
    starts = np.flatnonzero(np.diff(truth.track_id[order], prepend=-1))
    time_s, person, position = [np.empty(0)], [np.empty(0, np.int64)], [np.empty((0, 2))]
    for rows in np.split(order, starts[1:]) if len(order) else []:
        known_s = truth.time_s[rows]
        born_s = known_s[0] + rng.uniform(0.0, sensor.late_s)
        seen_s = instants[(instants >= born_s) & (instants <= known_s[-1])]
        time_s.append(seen_s)
        person.append(np.full(len(seen_s), truth.track_id[rows[0]]))
        position.append(
            np.stack([np.interp(seen_s, known_s, truth.position[rows, axis]) for axis in (0, 1)], axis=1)
        )
    when, who = np.concatenate(time_s), np.concatenate(person)
    where = measured(np.concatenate(position), sensor.noise_m, sensor.quantum_m, rng)
    kept = view.holds(where) & (rng.random(len(when)) >= sensor.drop_out)
    seen = Trajectories(when[kept], who[kept], where[kept], person_id=who[kept])
    if sensor.switch:
        seen = replace(seen, track_id=_switched(seen, sensor.switch, rng))
    return replace(scene, trajectories=seen, detection_dt_s=interval_s)


def _switched(seen: Trajectories, share: float, rng: np.random.Generator) -> np.ndarray:
    """Track ids after all swaps up to each instant. [M]."""
    names, person = np.unique(seen.track_id, return_inverse=True)
    called, track_id = names.copy(), np.empty_like(seen.track_id)
    starts = np.flatnonzero(np.diff(seen.time_s, prepend=-np.inf) > 0)
    for rows in np.split(np.arange(len(seen)), starts[1:]) if len(seen) else []:
        apart = np.linalg.norm(seen.position[rows, None] - seen.position[rows], axis=-1)
        near = np.argwhere(np.triu(apart < _SWITCH_RANGE_M, 1))
        for pair in near[rng.random(len(near)) < share]:
            who = person[rows[pair]]
            called[who] = called[who[::-1]]
        track_id[rows] = called[person[rows]]
    return track_id
