"""Training rows of networks without memory: tracked people of worlds and recordings, and their future."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from pedpred.features import Surroundings, neighbours_at
from pedpred.features.targets import Futures, future_velocities
from pedpred.geometry import rotate
from pedpred.models.features import RowFormat
from pedpred.scenes import Scene, Trajectories
from pedpred.settings import (
    LARGEST_SEED,
    In,
    Range,
    Settings,
    check_choice,
)
from pedpred.simulation.sensor import SensorSettings, apply_sensor, frames_between
from pedpred.simulation.worlds.drawing import log_uniform, uniform
from pedpred.simulation.worlds.floors import Area
from pedpred.simulation.worlds.sensing import SensedWorld, SensingSettings, sense_world
from pedpred.simulation.worlds.settings import WorldSettings
from pedpred.simulation.worlds.views import draw_view
from pedpred.simulation.worlds.world import KINDS, RECORD_S, simulate_world
from pedpred.tracking import KalmanBank, KalmanSettings, Tracks, follow
from pedpred.tracking.tracks import TIME_TOLERANCE_S, last_rows

Rows = dict[str, np.ndarray]


@dataclass(frozen=True)
class RowSettings(Settings):
    """How training rows vary.

    Attributes:
        seed: of everything but the worlds themselves.
        trackers: parameters of trackers in use.
        used_share: share of the recordings that one of those tracks.
        learning_share: share of the recordings whose tracker learns the noise of the detections.
        acceleration_noise: of other trackers, m^2/s^3; log-uniform.
        position_noise_m: of other trackers; log-uniform.
        initial_speed_mps: of other trackers.
        newborn_share: least expected share of the rows at the first detections of a track, which are rare
            where detections are many, but are what a robot sees when somebody appears.
        newborn: number of those detections.
        shifted_share: share of the rows whose map is shifted.
        shift_m: standard deviation of that shift along each axis.
    """

    seed: Annotated[int, In(f"[0, {LARGEST_SEED}]")]
    trackers: tuple[KalmanSettings, ...]
    used_share: Annotated[float, In("[0, 1]")]
    learning_share: Annotated[float, In("[0, 1]")]
    acceleration_noise: Annotated[Range, In("(0, 100]")]
    position_noise_m: Annotated[Range, In("(0, 100]")]
    initial_speed_mps: Annotated[Range, In("(0, 100]")]
    newborn_share: Annotated[float, In("[0, 1]")]
    newborn: Annotated[int, In("[0, 1000]")]
    shifted_share: Annotated[float, In("[0, 1]")]
    shift_m: Annotated[float, In("[0, 1000]")]


@dataclass(frozen=True)
class Recipe:
    """What all training rows have in common.

    Attributes:
        rows: how they vary.
        made_with: protocol and inputs.
        standstill_mps: below this speed the heading is held, m/s.
    """

    rows: RowSettings
    made_with: RowFormat
    standstill_mps: float


def draw_tracker(settings: RowSettings, rng: np.random.Generator) -> KalmanBank:
    """Draw a tracker: one filter, or several that learn the noise of the detections."""
    tracker = KalmanSettings(
        log_uniform(rng, settings.acceleration_noise),
        log_uniform(rng, settings.position_noise_m),
        uniform(rng, settings.initial_speed_mps),
    )
    if settings.trackers and rng.random() < settings.used_share:
        tracker = settings.trackers[rng.integers(len(settings.trackers))]
    return KalmanBank.around(tracker, learn_noise=rng.random() < settings.learning_share)


def training_rows(
    seen: Scene,
    truth: Trajectories,
    kalman: KalmanBank | None,
    most: int,
    recipe: Recipe,
    rng: np.random.Generator,
) -> Rows:
    """Track the people of a scene and collect random detections whose whole future is known.

    Args:
        seen: detections, and the map.
        truth: true paths of the people whom `person_id` of the detections names.
        kalman: filters of the tracker; None takes the true states.
        most: number of rows; fewer where there are not as many.
        recipe: protocol, inputs and variation.
        rng: source of all randomness.

    Returns:
        The inputs of a model, and `future`, m/s, agent frame, [M, P, 2] float32.
    """
    protocol, features = recipe.made_with.protocol, recipe.made_with.features
    kind = "truth" if kalman is None else "kalman"
    tracks = follow(seen.trajectories, kind, kalman, recipe.standstill_mps, protocol.lost_after_s)
    futures = Futures.of(truth, min(protocol.truth_gap_s, protocol.lost_after_s))
    row = np.flatnonzero(_with_future(tracks, futures, protocol.horizon_steps * protocol.dt_s))
    chance = _chances(tracks.age[row] < recipe.rows.newborn, recipe.rows.newborn_share)
    row = np.sort(rng.choice(row, min(most, len(row)), replace=False, p=chance))
    time_s, position, heading = tracks.time_s[row], tracks.position[row], tracks.heading_rad[row]
    around = neighbours_at(tracks, time_s, seen.detection_dt_s * protocol.max_age_intervals)
    inputs = features.compute(Surroundings.of(tracks, row, time_s, around, seen.occupancy), protocol.dt_s)
    moved = rng.random(len(row)) < recipe.rows.shifted_share
    beside = position[moved] + rng.normal(0.0, recipe.rows.shift_m, (moved.sum(), 2))
    for name, values in features.obstacle_inputs(seen.occupancy, beside, heading[moved]).items():
        inputs[name][moved] = values
    ahead_s = (np.arange(protocol.horizon_steps) + 1) * protocol.dt_s
    path, _ = futures.after(tracks.person_id[row], time_s, ahead_s)
    future = rotate(future_velocities(position, path, protocol.dt_s), -heading[:, None])
    return inputs | {"future": future.astype(np.float32)}


def _chances(newborn: np.ndarray, share: float) -> np.ndarray | None:
    """Probabilities of rows that give the newborn at least a share; None: equal ones. [M] bool -> [M]."""
    usual = newborn.mean() if len(newborn) else 0.0
    if not 0.0 < usual < share or share >= 1.0:
        return None
    return np.where(newborn, share / usual, (1.0 - share) / (1.0 - usual)) / len(newborn)


def _with_future(tracks: Tracks, futures: Futures, horizon_s: float) -> np.ndarray:
    """Detections after which the true path is known for `horizon_s`. [M] bool."""
    last = last_rows(futures.person_id, futures.time_s, tracks.person_id, tracks.time_s)
    if not len(futures.time_s):
        return np.zeros(len(last), bool)
    end_s = futures.time_s[futures.last[last] - 1]
    return (last >= 0) & (tracks.time_s + horizon_s <= end_s + TIME_TOLERANCE_S)


@dataclass(frozen=True)
class SimulatedSet(Settings):
    """A set of training rows of simulated people.

    Attributes:
        kind: of the worlds; those of kind "arrangement" are the scenes in folder `input`.
        input: what has to exist before the set is made.
        worlds: number of worlds or scenes.
        rows: of each, through a sensor and a tracker.
        true_rows: further rows of true states every `dt_s` of the channels.
        true_share: share of the worlds with those.
    """

    kind: str
    input: str
    worlds: Annotated[int, In("[1, 1000000]")]
    rows: Annotated[int, In("[0, 10000000]")]
    true_rows: Annotated[int, In("[0, 10000000]")]
    true_share: Annotated[float, In("[0, 1]")]

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("kind", self.kind, KINDS)


@dataclass(frozen=True)
class ViewingSettings(Settings):
    """How a recording is seen several times.

    Attributes:
        viewings: number of them.
        rows: largest number of rows of each.
        used_share: as in `RowSettings`.
        thinnings: where a sensor detects people in every n-th frame: factors on n, one of which is drawn.
        thinned_noise_m: standard deviations of a coordinate, one of which is drawn, in thinned recordings.
        noise_m: the same in annotated ones, whose positions are less precise.
    """

    viewings: Annotated[int, In("[1, 1000000]")]
    rows: Annotated[int, In("[1, 1000000]")]
    used_share: Annotated[float, In("[0, 1]")]
    thinnings: Annotated[tuple[float, ...], In("[0.1, 1000]")]
    thinned_noise_m: Annotated[tuple[float, ...], In("[0, 100]")]
    noise_m: Annotated[tuple[float, ...], In("[0, 100]")]


class WatchedScene(NamedTuple):
    """A simulated scene as one robot sees it.

    Attributes:
        view: what the sensor sees of the ground.
        sensed: detections, and the true heads of the people.
        kalman: filters of the tracker.
        rng: source of all further randomness.
    """

    view: Area
    sensed: SensedWorld
    kalman: KalmanBank
    rng: np.random.Generator


def watch_scene(scene: Scene, kind: str, sensing: SensingSettings, recipe: Recipe) -> WatchedScene:
    """Draw a view, a sensor and a tracker from the seed of the rows and the name of a scene alone.

    Args:
        scene: true positions and velocities at equal steps.
        kind: of world; it decides where sensors stand.
        sensing: ranges of the sensor.
        recipe: seed, and ranges of the tracker.
    """
    rng = np.random.default_rng([recipe.rows.seed, zlib.crc32(scene.name.encode())])
    view = draw_view(scene.occupancy, sensing.views[kind], rng)
    sensed = sense_world(refine(scene, RECORD_S), view, sensing, rng)
    return WatchedScene(view, sensed, draw_tracker(recipe.rows, rng), rng)


def collect_world_rows(
    number: int, chosen: SimulatedSet, worlds: WorldSettings, sensing: SensingSettings, recipe: Recipe
) -> Rows:
    """Simulate a world and collect its training rows; the same arguments give the same rows."""
    return collect_scene_rows(simulate_world(chosen.kind, number, worlds), chosen, sensing, recipe)


def collect_scene_rows(scene: Scene, chosen: SimulatedSet, sensing: SensingSettings, recipe: Recipe) -> Rows:
    """Collect the training rows of a simulated scene; see `collect_world_rows`.

    Args:
        scene: true positions and velocities at equal steps.
        chosen: numbers of rows.
        sensing: ranges of the sensor.
        recipe: protocol, inputs and variation of the rows.
    """
    watched = watch_scene(scene, chosen.kind, sensing, recipe)
    (seen, heads), rng = watched.sensed, watched.rng
    rows = training_rows(seen, heads.trajectories, watched.kalman, chosen.rows, recipe, rng)
    if rng.random() >= chosen.true_share:
        return rows
    states = select_true_states(scene, watched.view, recipe.made_with.protocol.dt_s)
    exact = training_rows(states, scene.trajectories, None, chosen.true_rows, recipe, rng)
    return {name: np.concatenate([rows[name], exact[name]]) for name in rows}


def select_true_states(scene: Scene, view: Area, dt_s: float) -> Scene:
    """What a perfect sensor detects in its view every `dt_s`, a multiple of the scene's interval."""
    trajectories = scene.trajectories
    tick = np.round(trajectories.time_s / scene.detection_dt_s).astype(int)
    kept = (tick % round(dt_s / scene.detection_dt_s) == 0) & view.holds(trajectories.position)
    return replace(scene, trajectories=trajectories.select(kept), detection_dt_s=dt_s)


def refine(scene: Scene, dt_s: float) -> Scene:
    """Interpolate recorded positions and velocities by cubic Hermite polynomials.

    Args:
        scene: with velocities; each track without gaps.
        dt_s: time between the new states; a scene that has this interval is returned as it is.
    """
    if abs(scene.detection_dt_s - dt_s) < 1e-9:
        return scene
    from scipy.interpolate import CubicHermiteSpline  # late: takes longer to import than all else here

    known = scene.trajectories
    assert known.velocity is not None
    order = np.lexsort((known.time_s, known.track_id))
    starts = np.flatnonzero(np.diff(known.track_id[order], prepend=-1))
    parts = []
    for rows in np.split(order, starts[1:]):
        if len(rows) > 1:
            path = CubicHermiteSpline(known.time_s[rows], known.position[rows], known.velocity[rows])
            ticks = np.round(known.time_s[rows[[0, -1]]] / dt_s).astype(int)
            now = np.round(np.arange(ticks[0], ticks[1] + 1) * dt_s, 9)
            who = np.full(len(now), known.track_id[rows[0]])
            parts.append((now, who, path(now), path(now, 1)))
    states = Trajectories(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return replace(scene, trajectories=states, detection_dt_s=dt_s)


def collect_viewing_rows(
    number: int, scene: Scene, rate_hz: float, settings: ViewingSettings, recipe: Recipe
) -> Rows:
    """Collect the training rows of one viewing of a recording; the same arguments give the same rows.

    Args:
        number: of the viewing.
        scene: all recorded detections, which are the truth.
        rate_hz: of the place's sensor; 0: it detects people in all frames.
        settings: how viewings vary.
        recipe: protocol, inputs and variation of the rows.
    """
    rng = np.random.default_rng([recipe.rows.seed, zlib.crc32(scene.name.encode()), number])
    frame_s = scene.detection_dt_s
    every = frames_between(rate_hz, frame_s)
    if every > 1:
        every = max(2, int(every * rng.choice(settings.thinnings)))
        noise_m = float(rng.choice(settings.thinned_noise_m))
    else:
        noise_m = float(rng.choice(settings.noise_m))
    truth = scene.trajectories
    _, instant = np.unique(truth.time_s, return_inverse=True)
    later = replace(scene, trajectories=truth.select(instant >= rng.integers(every)))
    sensor = SensorSettings(rate_hz=1.0 / (every * frame_s), position_noise_m=noise_m)
    seen = apply_sensor(later, sensor, rng)
    kalman = draw_tracker(replace(recipe.rows, used_share=settings.used_share), rng)
    return training_rows(seen, truth, kalman, settings.rows, recipe, rng)
