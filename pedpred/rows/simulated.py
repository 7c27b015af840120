"""Rows of simulated people: random rows, or all steps of their tracks, as a random sensor sees them.

Networks with and without a memory learn from the same worlds, sensors and trackers.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from pedpred.features import FeatureTable, extract_blocks
from pedpred.rows.sampling import Rows, RowSampling, draw_tracker, sample_rows
from pedpred.scenes import Scene, Trajectories
from pedpred.settings import In, Settings, check_choice
from pedpred.simulation.worlds.floors import Area
from pedpred.simulation.worlds.sensing import SensedWorld, SensingSettings, sense_world
from pedpred.simulation.worlds.settings import WorldSettings
from pedpred.simulation.worlds.views import draw_view
from pedpred.simulation.worlds.world import DRAWN_KINDS, KINDS, RECORD_S, simulate_world
from pedpred.tracking import KalmanBank, follow


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
class SequenceSets(Settings):
    """Simulated people whose steps are kept.

    Attributes:
        scenes: rows of conf/simulations, which are perceived as these say.
        worlds: kind of world -> number of worlds.
    """

    scenes: tuple[str, ...]
    worlds: Mapping[str, Annotated[int, In("[1, 1000000]")]]

    def __post_init__(self) -> None:
        super().__post_init__()
        for kind in self.worlds:
            check_choice("worlds", kind, DRAWN_KINDS)


class SensedScene(NamedTuple):
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


def sense_scene(scene: Scene, kind: str, sensing: SensingSettings, sampling: RowSampling) -> SensedScene:
    """Draw a view, a sensor and a tracker from the seed of the rows and the name of a scene alone.

    Args:
        scene: true positions and velocities at equal steps.
        kind: of world; it decides where sensors stand.
        sensing: ranges of the sensor.
        sampling: seed, and ranges of the tracker.
    """
    rng = np.random.default_rng([sampling.rows.seed, zlib.crc32(scene.name.encode())])
    view = draw_view(scene.occupancy, sensing.views[kind], rng)
    sensed = sense_world(resample_hermite(scene, RECORD_S), view, sensing, rng)
    return SensedScene(view, sensed, draw_tracker(sampling.rows, rng), rng)


def rows_of_world(
    number: int, chosen: SimulatedSet, worlds: WorldSettings, sensing: SensingSettings, sampling: RowSampling
) -> Rows:
    """Simulate a world and sample its rows; the same arguments give the same rows."""
    return rows_of_scene(simulate_world(chosen.kind, number, worlds), chosen, sensing, sampling)


def rows_of_scene(
    scene: Scene, chosen: SimulatedSet, sensing: SensingSettings, sampling: RowSampling
) -> Rows:
    """Sample the rows of a simulated scene.

    Args:
        scene: true positions and velocities at equal steps.
        chosen: numbers of rows.
        sensing: ranges of the sensor.
        sampling: protocol, inputs and variation of the rows.
    """
    sensed = sense_scene(scene, chosen.kind, sensing, sampling)
    (seen, heads), rng = sensed.sensed, sensed.rng
    rows = sample_rows(seen, heads.trajectories, sensed.kalman, chosen.rows, sampling, rng)
    if rng.random() >= chosen.true_share:
        return rows
    states = select_true_states(scene, sensed.view, sampling.row_format.protocol.dt_s)
    exact = sample_rows(states, scene.trajectories, None, chosen.true_rows, sampling, rng)
    return {name: np.concatenate([rows[name], exact[name]]) for name in rows}


def steps_of_world(
    kind: str, number: int, worlds: WorldSettings, sensing: SensingSettings, sampling: RowSampling
) -> Iterator[FeatureTable]:
    """Simulate a world and keep all steps of the tracks that a random sensor and tracker see.

    Args:
        kind: of the world.
        number: of the world; the same arguments give the same steps.
        worlds: ranges that it is drawn from.
        sensing: ranges of the sensor.
        sampling: protocol, inputs and trackers.
    """
    sensed = sense_scene(simulate_world(kind, number, worlds), kind, sensing, sampling)
    (seen, heads), row_format, still_mps = sensed.sensed, sampling.row_format, sampling.standstill_mps
    protocol = row_format.protocol
    tracks = follow(seen.trajectories, "kalman", sensed.kalman, still_mps, protocol.lost_after_s)
    return extract_blocks(seen, tracks, protocol, row_format.features, truth=heads.trajectories)


def select_true_states(scene: Scene, view: Area, dt_s: float) -> Scene:
    """What a perfect sensor detects in its view every `dt_s`, a multiple of the scene's interval."""
    trajectories = scene.trajectories
    tick = np.round(trajectories.time_s / scene.detection_dt_s).astype(int)
    kept = (tick % round(dt_s / scene.detection_dt_s) == 0) & view.holds(trajectories.position)
    return replace(scene, trajectories=trajectories.select(kept), detection_dt_s=dt_s)


def resample_hermite(scene: Scene, dt_s: float) -> Scene:
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
