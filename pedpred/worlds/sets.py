"""Sets of training rows: of simulated worlds, of simulated scenes on disk, and of viewings of a recording."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from pedpred.scenes import Scene, Trajectories
from pedpred.simulation.fields import check_choice
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.worlds.drawing import check_intervals
from pedpred.worlds.floors import Area
from pedpred.worlds.sensing import SensingSettings, sense_world
from pedpred.worlds.settings import WorldSettings
from pedpred.worlds.situations import Recipe, drawn_tracker, training_rows
from pedpred.worlds.views import VIEWED, drawn_view
from pedpred.worlds.world import RECORD_S, simulate_world

Rows = dict[str, np.ndarray]


@dataclass(frozen=True)
class SimulatedSet:
    """A set of training rows of simulated people.

    Attributes:
        kind: of the worlds; "scene" takes the scenes in folder `input` instead.
        input: what has to exist before the set is made.
        worlds: number of worlds or scenes.
        rows: of each, through a sensor and a tracker.
        true_rows: further rows of true states every `dt_s` of the channels.
        true_share: share of the worlds with those.
    """

    kind: str
    input: str
    worlds: int
    rows: int
    true_rows: int
    true_share: float

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, VIEWED)
        check_intervals(self, {"[1, 1000000]": "worlds", "[0, 10000000]": "rows true_rows"})


@dataclass(frozen=True)
class ViewingSettings:
    """How a recording is seen several times.

    Attributes:
        viewings: number of them.
        rows: largest number of rows of each.
        used_share: as in `RowSettings`.
        thinnings: where a sensor takes every n-th frame: factors on n, of which each viewing draws one.
        thinned_noise_m: standard deviations of a coordinate, one of which is drawn, in thinned recordings.
        noise_m: the same in annotated ones, whose positions are less precise.
    """

    viewings: int
    rows: int
    used_share: float
    thinnings: tuple[float, ...]
    thinned_noise_m: tuple[float, ...]
    noise_m: tuple[float, ...]

    def __post_init__(self) -> None:
        check_intervals(self, {"[1, 1000000]": "viewings rows", "[0.1, 1000]": "thinnings"})
        check_intervals(self, {"[0, 100]": "thinned_noise_m noise_m"})


def world_rows(
    number: int, chosen: SimulatedSet, worlds: WorldSettings, sensing: SensingSettings, recipe: Recipe
) -> Rows:
    """Simulate a world and collect its training rows; the same arguments give the same rows."""
    return scene_rows(simulate_world(chosen.kind, number, worlds), chosen, sensing, recipe)


def scene_rows(scene: Scene, chosen: SimulatedSet, sensing: SensingSettings, recipe: Recipe) -> Rows:
    """Collect the training rows of a simulated scene; see `world_rows`.

    Args:
        scene: true positions and velocities at equal steps.
        chosen: numbers of rows.
        sensing: ranges of the sensor.
        recipe: sizes and variation of the rows.
    """
    rng = np.random.default_rng([recipe.rows.seed, zlib.crc32(scene.name.encode())])
    view = drawn_view(scene.occupancy, sensing.views[chosen.kind], rng)
    seen, heads = sense_world(refined(scene, RECORD_S), view, sensing, rng)
    kalman = drawn_tracker(recipe.rows, rng)
    rows = training_rows(seen, heads.trajectories, kalman, chosen.rows, recipe, rng)
    if rng.random() >= chosen.true_share:
        return rows
    states = true_states(scene, view, recipe.sizes.dt_s)
    exact = training_rows(states, scene.trajectories, None, chosen.true_rows, recipe, rng)
    return {name: np.concatenate([rows[name], exact[name]]) for name in rows}


def true_states(scene: Scene, view: Area, dt_s: float) -> Scene:
    """What a perfect sensor detects in its view every `dt_s`, a multiple of the scene's interval."""
    trajectories = scene.trajectories
    tick = np.round(trajectories.time_s / scene.detection_dt_s).astype(int)
    kept = (tick % round(dt_s / scene.detection_dt_s) == 0) & view.holds(trajectories.position)
    return replace(scene, trajectories=trajectories.select(kept), detection_dt_s=dt_s)


def refined(scene: Scene, dt_s: float) -> Scene:
    """Interpolate recorded positions and velocities by cubic Hermite polynomials.

    Args:
        scene: with velocities; each track without gaps.
        dt_s: time between the new states; a scene that has this interval is returned as it is.
    """
    if abs(scene.detection_dt_s - dt_s) < 1e-9:
        return scene
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


def viewing_rows(number: int, scene: Scene, every: int, settings: ViewingSettings, recipe: Recipe) -> Rows:
    """Collect the training rows of one viewing of a recording; the same arguments give the same rows.

    Args:
        number: of the viewing.
        scene: all recorded detections, which are the truth.
        every: the sensor of the place takes every n-th frame.
        settings: how viewings vary.
        recipe: sizes and variation of the rows.
    """
    rng = np.random.default_rng([recipe.rows.seed, zlib.crc32(scene.name.encode()), number])
    if every > 1:
        every = max(2, int(every * rng.choice(settings.thinnings)))
        noise_m = float(rng.choice(settings.thinned_noise_m))
    else:
        noise_m = float(rng.choice(settings.noise_m))
    truth = scene.trajectories
    _, instant = np.unique(truth.time_s, return_inverse=True)
    later = replace(scene, trajectories=truth.select(instant >= rng.integers(every)))
    seen = apply_sensor(later, SensorSettings(every=every, position_noise_m=noise_m), rng)
    kalman = drawn_tracker(replace(recipe.rows, used_share=settings.used_share), rng)
    return training_rows(seen, truth, kalman, settings.rows, recipe, rng)
