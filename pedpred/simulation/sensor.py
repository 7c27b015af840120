"""What a detector makes of a scene: its rate, noise, missed detections and swapped ids.

One sensor serves the features of scenes and the training rows of simulated worlds. The first has frames: it
sees every n-th recorded instant, and the faults are those of the recording's frames. The second runs by its
own clock: it sees people between recorded instants, and the faults are those of its detections.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import Scene, Trajectories
from pedpred.settings import (
    LARGEST_SEED,
    In,
    Settings,
)

InView = Callable[[np.ndarray], np.ndarray]
"""Whether points (world frame, m, [M, 2]) are seen. [M] bool"""


@dataclass(frozen=True)
class SensorSettings(Settings):
    """Rate and faults of a sensor; the defaults are a perfect one.

    Attributes:
        rate_hz: detections per second; 0: at every recorded instant.
        own_clock: whether the instants are the sensor's own, with a random phase. Otherwise people are
            detected at every n-th recorded instant, with the n whose rate is closest (`frames_between`).
        jitter_s: largest shift of an instant of its own clock.
        late_s: longest time until somebody is detected first, by its own clock.
        position_noise_m: standard deviation of a coordinate, m.
        quantum_m: coordinates are rounded to multiples of this; 0 = not at all, m.
        drop_out_share: share of missing detections.
        switch_share: share of the instants at which pairs of mutual nearest neighbours within
            `switch_range_m` swap their ids permanently. By its own clock: probability at each instant that
            two people within that range do.
        switch_range_m: m.
        seed: of the faults.
    """

    rate_hz: Annotated[float, In("[0, 1000]")] = 0.0
    own_clock: bool = False
    jitter_s: Annotated[float, In("[0, 1000]")] = 0.0
    late_s: Annotated[float, In("[0, 1000]")] = 0.0
    position_noise_m: Annotated[float, In("[0, 1000]")] = 0.0
    quantum_m: Annotated[float, In("[0, 1000]")] = 0.0
    drop_out_share: Annotated[float, In("[0, 1)")] = 0.0
    switch_share: Annotated[float, In("[0, 1]")] = 0.0
    switch_range_m: Annotated[float, In("[0, 1000]")] = 0.8
    seed: Annotated[int, In(f"[0, {LARGEST_SEED}]")] = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.own_clock and not self.rate_hz:
            raise ValueRuleError("rate_hz", self.rate_hz, "a sensor with its own clock needs a rate")
        for name in ("jitter_s", "late_s"):
            if getattr(self, name) and not self.own_clock:
                raise ValueRuleError(name, getattr(self, name), "only a sensor with its own_clock has it")


def frames_between(rate_hz: float, frame_s: float) -> int:
    """Return the n of a sensor that detects people in every n-th frame, about `rate_hz` times a second.

    Args:
        rate_hz: detections per second; 0: in every frame.
        frame_s: time between two frames.
    """
    return max(1, round(1.0 / (rate_hz * frame_s))) if rate_hz else 1


def apply_sensor(
    scene: Scene, settings: SensorSettings, rng: np.random.Generator, in_view: InView | None = None
) -> Scene:
    """Replace the detections of a scene by those of a faulty sensor; `person_id` keeps the true identity.

    Velocities, goals and groups are dropped.

    Args:
        scene: true positions; for a sensor with its own clock at short equal steps, each track without gaps.
        settings: rate and faults.
        rng: source of all randomness; derive it from (seed, scene).
        in_view: where people are detected; None: everywhere.
    """
    if settings.own_clock:
        people = _people_by_clock(scene, settings, rng)
        track_id = people.person_id
    else:
        people = _people_in_frames(scene, settings)
        track_id = _swap_ids(people.time_s, people.person_id, people.position, settings, rng)
    position = measure(people.position, settings.position_noise_m, settings.quantum_m, rng)
    kept = people.due & (rng.random(len(position)) >= settings.drop_out_share)
    if in_view is not None:
        kept &= in_view(position)
    seen = Trajectories(people.time_s[kept], track_id[kept], position[kept], person_id=people.person_id[kept])
    if settings.own_clock and settings.switch_share:
        swapped = _swap_ids(seen.time_s, seen.track_id, seen.position, settings, rng)
        seen = replace(seen, track_id=swapped)
    return replace(scene, trajectories=seen, detection_dt_s=people.interval_s)


def measure(position: np.ndarray, noise_m: float, quantum_m: float, rng: np.random.Generator) -> np.ndarray:
    """Add noise to coordinates, m, and round them to multiples of the quantum, if there is one. [M, 2]."""
    noisy = position + rng.normal(0.0, noise_m, position.shape)
    return np.round(noisy / quantum_m) * quantum_m if quantum_m else noisy


class _People(NamedTuple):
    """True positions that a sensor may detect.

    Attributes:
        time_s: [M]
        person_id: [M]
        position: world frame, m. [M, 2]
        due: whether the sensor looks at this instant. [M] bool
        interval_s: time between two detections of a person.
    """

    time_s: np.ndarray
    person_id: np.ndarray
    position: np.ndarray
    due: np.ndarray
    interval_s: float


def _people_in_frames(scene: Scene, settings: SensorSettings) -> _People:
    """All recorded positions, of which every n-th instant is due."""
    truth, every = scene.trajectories, frames_between(settings.rate_hz, scene.detection_dt_s)
    _, instant = np.unique(truth.time_s, return_inverse=True)
    due = instant % every == 0
    return _People(truth.time_s, truth.track_id, truth.position, due, scene.detection_dt_s * every)


def _people_by_clock(scene: Scene, settings: SensorSettings, rng: np.random.Generator) -> _People:
    """Positions at the instants of the sensor; between recorded ones people walk straight."""
    truth, interval_s = scene.trajectories, 1.0 / settings.rate_hz
    end_s = float(truth.time_s.max(initial=0.0))
    instants = np.arange(rng.uniform(0.0, interval_s), end_s, interval_s)
    instants += rng.uniform(-settings.jitter_s, settings.jitter_s, len(instants))
    instants = np.unique(np.clip(instants, 0.0, end_s))
    times_s, people, positions = [np.empty(0)], [np.empty(0, np.int64)], [np.empty((0, 2))]
    for rows in truth.by_track():
        known_s = truth.time_s[rows]
        first_s = known_s[0] + rng.uniform(0.0, settings.late_s)
        seen_s = instants[(instants >= first_s) & (instants <= known_s[-1])]
        x, y = (np.interp(seen_s, known_s, truth.position[rows, axis]) for axis in (0, 1))
        times_s.append(seen_s)
        people.append(np.full(len(seen_s), truth.track_id[rows[0]]))
        positions.append(np.stack([x, y], axis=1))
    time_s = np.concatenate(times_s)
    due = np.ones(len(time_s), dtype=bool)
    return _People(time_s, np.concatenate(people), np.concatenate(positions), due, interval_s)


def _swap_ids(
    time_s: np.ndarray,
    track_id: np.ndarray,
    position: np.ndarray,
    settings: SensorSettings,
    rng: np.random.Generator,
) -> np.ndarray:
    """Track ids after all swaps up to each instant; rows in the order of time. [M]."""
    names, person = np.unique(track_id, return_inverse=True)
    called, swapped = names.copy(), np.empty_like(track_id)
    starts = np.flatnonzero(np.diff(time_s, prepend=-np.inf) > 0)
    for rows in np.split(np.arange(len(time_s)), starts[1:]) if len(time_s) else []:
        for pair in _draw_swapping_pairs(position[rows], settings, rng):
            who = person[rows[pair]]
            called[who] = called[who[::-1]]
        swapped[rows] = called[person[rows]]
    return swapped


def _draw_swapping_pairs(
    position: np.ndarray, settings: SensorSettings, rng: np.random.Generator
) -> np.ndarray:
    """Draw which people of an instant (m, [N, 2]) swap their ids. Rows of pairs, [S, 2]."""
    nobody = np.empty((0, 2), dtype=np.int64)
    if not settings.own_clock and (rng.random() >= settings.switch_share or len(position) < 2):
        return nobody
    apart = np.linalg.norm(position[:, None] - position[None], axis=-1)
    if settings.own_clock:
        near = np.argwhere(np.triu(apart < settings.switch_range_m, 1))
        return near[rng.random(len(near)) < settings.switch_share]
    np.fill_diagonal(apart, np.inf)
    nearest = apart.argmin(axis=1)
    mutual = (nearest[nearest] == np.arange(len(position))) & (apart.min(axis=1) <= settings.switch_range_m)
    first = np.flatnonzero(mutual & (np.arange(len(position)) < nearest))
    return np.stack([first, nearest[first]], axis=1)
