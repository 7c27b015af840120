"""Social forces with oracle knowledge: every pedestrian's true goal.

All people of an instant are rolled out together, without noise, by the simulator's own kernel.
Simulated scenes know the goals and desired speeds, so that the noise is the only source of error; in real
ones the goal is the end of the track, the desired speed the tracked one, and groups are the annotated ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.features.surroundings import present_rows
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.geometry import rotate
from pedpred.scenes import Predictions, Scene, Trajectories
from pedpred.simulation.crowd import Crowd, crowd_of
from pedpred.simulation.ground import Ground, ground_around
from pedpred.simulation.routing import Routes, routes_to
from pedpred.simulation.settings import RoutingSettings, SocialForceSettings
from pedpred.simulation.simulator import rollout
from pedpred.tracking.tracks import TIME_TOLERANCE_S

GOALS_AHEAD = 4  # enough for a horizon of some seconds


def social_force() -> Forecaster:
    """Make the forecaster; it has no settings."""

    def forecast(request: ForecastRequest) -> Predictions:
        sizes, model = request.sizes, request.walking_model
        people, asked = people_present(request)
        start = initial_state(request.scene, *people, model.routing)
        return Predictions.single(start.paths(model, sizes.horizon_steps, sizes.dt_s)[asked], sizes.dt_s)

    return forecast


class Present(NamedTuple):
    """All people at some instants, by track and instant. World frame.

    Attributes:
        track_id: [R]
        time_s: the instant, s. [R]
        position: tracked; extrapolated from the last detection if that is earlier, m. [R, 2]
        velocity: tracked, m/s. [R, 2]
    """

    track_id: np.ndarray
    time_s: np.ndarray
    position: np.ndarray
    velocity: np.ndarray


def people_present(request: ForecastRequest) -> tuple[Present, np.ndarray]:
    """Collect all people at the instants of the asked rows, and find those rows among them.

    As for the inputs of networks, people are present while their last detection is at most
    `max_age_intervals` old.

    Returns:
        People [R], and the index of each asked row. [W]
    """
    table = request.table
    now_s, instant = np.unique(table.time_s[request.rows], return_inverse=True)
    row, at = present_rows(table.track_id, table.time_s, now_s, request.max_age_s)
    _, track = np.unique(table.track_id, return_inverse=True)
    key = track[row] * len(now_s) + at
    order = np.argsort(key)
    row, time_s = row[order], now_s[at[order]]
    velocity = rotate(table.velocity[row], table.heading_rad[row]).astype(np.float64)
    position = table.position[row] + (time_s - table.time_s[row])[:, None] * velocity
    asked = np.searchsorted(key[order], track[request.rows] * len(now_s) + instant)
    return Present(table.track_id[row], time_s, position, velocity), asked


class Intentions(NamedTuple):
    """Goals, plans and companions of some pedestrians, row by row.

    Attributes:
        goals: of all pedestrians, world frame, m. [G, 2]
        plan: the next goals in order, indices into `goals`; -1 = none. [W, K]
        desired_speed: m/s. [W]
        group: equal numbers walk together; -1 = alone. [W]
    """

    goals: np.ndarray
    plan: np.ndarray
    desired_speed: np.ndarray
    group: np.ndarray


class InitialState(NamedTuple):
    """The state at the start of the rollouts; it does not depend on the forces.

    Attributes:
        crowd: all people at every instant. [W]
        time_s: the instant. [W]
        ground: obstacles.
        routes: ways to all goals.
    """

    crowd: Crowd
    time_s: np.ndarray
    ground: Ground
    routes: Routes

    def paths(self, model: SocialForceSettings, horizon_steps: int, dt_s: float) -> np.ndarray:
        """World positions after 1 ... P steps of `dt_s`, without noise; those of one instant walk together.

        Args:
            model: forces and integration step.
            horizon_steps: P.
            dt_s: time between two steps, s.

        Returns:
            m. [W, P, 2]
        """
        paths = np.empty((len(self.time_s), horizon_steps, 2))
        for rows in rows_of_instants(self.time_s):
            crowd = Crowd(*(values[rows] for values in self.crowd))
            paths[rows] = rollout(crowd, self.ground, self.routes, model, horizon_steps, dt_s)
        return paths


def rows_of_instants(time_s: np.ndarray) -> list[np.ndarray]:
    """Rows of each instant, in the order of time. [W] -> [N] each."""
    order = np.argsort(time_s, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(time_s[order])) + 1)
    return parts if len(order) else []


def initial_state(
    scene: Scene,
    track_id: np.ndarray,
    time_s: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    routing: RoutingSettings,
) -> InitialState:
    """Collect pedestrians with their true goals, and the ways there.

    Rows of the same instant walk together: give all people who are present, not only those asked for.

    Args:
        scene: recording (for goals and groups) and obstacles.
        track_id: whose row. [W]
        time_s: the instant. [W]
        position: tracked, world frame, m. [W, 2]
        velocity: tracked, m/s. [W, 2]
        routing: how people find their way.

    Raises:
        ValueRuleError: a row's track is not in the recording.
    """
    position, velocity = (np.asarray(v, dtype=np.float64).reshape(-1, 2) for v in (position, velocity))
    time_s = np.asarray(time_s, dtype=np.float64)
    wanted = intentions(scene.trajectories, np.asarray(track_id), time_s, velocity)
    ground = ground_around(scene.occupancy, np.vstack([position, wanted.goals]), routing.resolution_m)
    crowd = crowd_of(position, velocity, wanted.desired_speed, wanted.plan, wanted.group)
    return InitialState(crowd, time_s, ground, routes_to(wanted.goals, ground, routing))


def intentions(
    trajectories: Trajectories, track_id: np.ndarray, time_s: np.ndarray, velocity: np.ndarray
) -> Intentions:
    """Read true goals, speeds and groups; where missing, use track ends, tracked speeds and no groups.

    Args:
        trajectories: of the scene.
        track_id: whose row. [W]
        time_s: the instant. [W]
        velocity: tracked, m/s. [W, 2]
    """
    known = trajectories.goal is not None
    order = np.lexsort((trajectories.time_s, trajectories.track_id))  # each track in one piece
    track = trajectories.track_id[order]
    place = (trajectories.position if trajectories.goal is None else trajectories.goal)[order]
    now = _latest_rows(track, trajectories.time_s[order], track_id, time_s)
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
    if trajectories.desired_speed_mps is not None:
        speed = trajectories.desired_speed_mps[order][now]
    group = np.full(len(now), -1) if trajectories.group_id is None else trajectories.group_id[order][now]
    return Intentions(goals, plan, speed, group)


def _latest_rows(
    track: np.ndarray, times_s: np.ndarray, track_id: np.ndarray, time_s: np.ndarray
) -> np.ndarray:
    """Index of each track's last detection up to an instant (its first one if there is none yet). [W]."""
    rows = np.empty(len(track_id), dtype=np.int64)
    for asked in np.unique(track_id):
        first, last = (np.searchsorted(track, asked, side) for side in ("left", "right"))
        if first == last:
            raise ValueRuleError("track_id", int(asked), "the recording has no such track")
        mask = track_id == asked
        latest = np.searchsorted(times_s[first:last], time_s[mask] + TIME_TOLERANCE_S, side="right") - 1
        rows[mask] = first + np.maximum(latest, 0)
    return rows
