"""Social forces with oracle knowledge: every pedestrian's true goal.

All pedestrians of an instant are rolled out together, without noise, by the simulator's own kernel.
In simulated scenes the recording knows the goals and desired speeds, so only the noise is left to
be wrong about; in real ones the goal is the end of the track and the desired speed the tracked one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from pedpred.baselines.together import SAME_TIME_S, rolled_out
from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap, Recording, Scene
from pedpred.simulation.crowd import Crowd
from pedpred.simulation.ground import Ground, ground_of
from pedpred.simulation.routing import routes_to
from pedpred.simulation.settings import social_force_settings

GOALS_AHEAD = 4  # nobody reaches more within a horizon of some seconds
_FREE_MARGIN_M = 3.0  # ground around the map where people may walk; no border is felt farther away


class Intentions(NamedTuple):
    """What some pedestrians want, row by row.

    Attributes:
        goals: all places that anybody wants to reach, world frame, m. [G, 2]
        plan: the next goals in order, indices into `goals`; -1 = none. [W, K]
        desired_speed: m/s. [W]
    """

    goals: np.ndarray
    plan: np.ndarray
    desired_speed: np.ndarray


def social_force_paths(
    scene: Scene,
    track_id: np.ndarray,
    time_s: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    settings: Mapping[str, Any],
    horizon_steps: int,
    dt_s: float,
) -> np.ndarray:
    """Future paths of pedestrians who know where they are going.

    Rows of the same instant walk together, so give all who are present, not just those of interest.

    Args:
        scene: recording (for the goals) and obstacles.
        track_id: whose row. [W]
        time_s: the instant. [W]
        position: tracked, world frame, m. [W, 2]
        velocity: tracked, m/s. [W, 2]
        settings: configuration group `social_force`.
        horizon_steps: P.
        dt_s: time between two steps of the horizon, s.

    Returns:
        World positions at time_s + dt_s * (1 ... P), m. [W, P, 2]

    Raises:
        ValueRuleError: a row's track is not in the recording.
    """
    model = social_force_settings(settings)
    position, velocity = np.asarray(position, dtype=np.float64), np.asarray(velocity, dtype=np.float64)
    if not len(position):
        return np.empty((0, horizon_steps, 2))
    wanted = intentions(scene.recording, np.asarray(track_id), np.asarray(time_s), velocity)
    ground = _surroundings(scene.occupancy, np.vstack([position, wanted.goals]), model.routing.resolution_m)
    routes = routes_to(wanted.goals, ground, model.routing)
    legs = np.zeros(len(position), dtype=np.int64)
    crowd = Crowd(position, velocity, wanted.desired_speed, wanted.plan, legs)
    return rolled_out(crowd, np.asarray(time_s), ground, routes, model, horizon_steps, dt_s)


def intentions(
    recording: Recording, track_id: np.ndarray, time_s: np.ndarray, velocity: np.ndarray
) -> Intentions:
    """True goals and desired speeds where the recording has them, else track ends and tracked speeds.

    Args:
        recording: of the scene.
        track_id: whose row. [W]
        time_s: the instant. [W]
        velocity: tracked, m/s. [W, 2]
    """
    known = recording.goal is not None
    order = np.lexsort((recording.time_s, recording.track_id))  # each track in one piece
    track = recording.track_id[order]
    place = (recording.position if recording.goal is None else recording.goal)[order]
    now = _latest_rows(track, recording.time_s[order], track_id, time_s)
    changes = np.diff(track) != 0
    if known:
        changes |= (np.diff(place, axis=0) != 0).any(axis=1)
    run = np.concatenate([[0], np.cumsum(changes)])  # consecutive rows of one goal
    run_end = np.append(np.flatnonzero(changes), len(track) - 1)
    ahead = run[now][:, None] + np.arange(GOALS_AHEAD if known else 1)
    end = run_end[np.minimum(ahead, len(run_end) - 1)]
    valid = (ahead < len(run_end)) & (track[end] == track_id[:, None])
    goals, used = np.unique(place[end[valid]], axis=0, return_inverse=True)
    plan = np.full(valid.shape, -1, dtype=np.int64)
    plan[valid] = used.ravel()
    speed = np.linalg.norm(velocity, axis=-1)
    if recording.desired_speed_mps is not None:
        speed = recording.desired_speed_mps[order][now]
    return Intentions(goals, plan, speed)


def _latest_rows(
    track: np.ndarray, times_s: np.ndarray, track_id: np.ndarray, time_s: np.ndarray
) -> np.ndarray:
    """Index of each track's last detection up to an instant (its first one if there is none yet).

    Args:
        track: of all detections, sorted. [M]
        times_s: of all detections, sorted within a track. [M]
        track_id: asked for. [W]
        time_s: asked for. [W]
    """
    rows = np.empty(len(track_id), dtype=np.int64)
    for asked in np.unique(track_id):
        first, last = np.searchsorted(track, [asked, asked + 1])
        if first == last:
            raise ValueRuleError("track_id", int(asked), "the recording has no such track")
        mask = track_id == asked
        found = np.searchsorted(times_s[first:last], time_s[mask] + SAME_TIME_S, side="right") - 1
        rows[mask] = first + np.maximum(found, 0)
    return rows


def _surroundings(occupancy: OccupancyMap, points: np.ndarray, routing_m: float) -> Ground:
    """The map with free ground around it that holds all points, in whole routing cells."""
    beyond = max(
        float((occupancy.origin - points).max()),
        float((points - occupancy.origin - occupancy.extent_m).max()),
        0.0,
    )
    cells = max(round(routing_m / occupancy.resolution_m), 1)
    margin_m = beyond + _FREE_MARGIN_M
    return ground_of(occupancy, cells * int(np.ceil(margin_m / (cells * occupancy.resolution_m))))
