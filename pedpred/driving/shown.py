"""Single drives as scenes and recordings, and which episodes of a table are worth showing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.driving.episodes import Episode, Place
from pedpred.driving.figures import Episodes
from pedpred.driving.loop import Drive
from pedpred.driving.measures import find_contacts
from pedpred.driving.robot import Robot
from pedpred.driving.table import Condition, Row
from pedpred.features import ForecastProtocol
from pedpred.online.replay import as_windows
from pedpred.ros import write_recording
from pedpred.scenes import Scene, Trajectories

_COLOUR = (0.84, 0.37, 0.0)


def choose_episodes(rows: Sequence[Row], one: Condition, other: Condition) -> dict[str, int]:
    """Choose episodes of a table by how two conditions differ in them.

    Episodes are sorted by what `one` avoids: a collision at fault, then collisions, then time.

    Returns:
        `helps`: the episode in which `one` avoids most; `hinders`: least; `usual`: the one in the middle.
        Of few episodes, each has its first name only.
    """
    each = Episodes.of(rows)
    contacts, time_s = each.value["contacts"], each.value["time_s"]
    avoided = (
        each.at_fault(other) - each.at_fault(one), contacts[other] - contacts[one],
        np.round(time_s[other] - time_s[one], 6), -each.number,
    )  # fmt: skip
    order = [int(n) for n in each.number[np.lexsort(avoided[::-1])]]
    chosen = {"helps": order[-1], "hinders": order[0], "usual": order[len(order) // 2]}
    return {name: n for k, (name, n) in enumerate(chosen.items()) if n not in list(chosen.values())[:k]}


def as_scene(done: Drive, place: Place, episode: Episode) -> Scene:
    """The true people of a drive, and its robot as the track with the largest id."""
    start_s, ids = episode.watching * done.dt_s, episode.crowd().track_id
    tick, who = np.nonzero(np.isfinite(done.people[..., 0]))
    ticks = np.arange(len(done.state))
    robot = int(ids.max(initial=0)) + 1
    everybody = Trajectories(
        start_s + np.concatenate([tick, ticks]) * done.dt_s,
        np.concatenate([ids[who], np.full(len(ticks), robot)]),
        np.concatenate([done.people[tick, who], done.state[:, :2]]),
    )
    return Scene(place.name, everybody, place.occupancy, done.dt_s)


def describe(done: Drive, episode: Episode, condition: Condition, robot: Robot) -> dict[str, Any]:
    """What a picture of a drive shows beside its scene, as plain values."""
    contacts, way = find_contacts(done, robot.radius_m), done.state[:, :2]
    at = way[np.minimum(np.round(contacts.time_s / done.dt_s).astype(int), len(way) - 1)]
    places = [[round(float(v), 3) for v in point] for point in at]
    return {
        "method": condition.method,
        "risk": condition.risk,
        "time_s": round((len(way) - 1) * done.dt_s, 3),
        "reached": done.reached,
        "radius_m": robot.radius_m,
        "goal": [round(float(v), 3) for v in episode.course.goal],
        "contacts": [{"at": a, "fault": bool(f)} for a, f in zip(places, contacts.fault, strict=True)],
    }


def write_drive(
    done: Drive, scene: Scene, episode: Episode, method: str, protocol: ForecastProtocol, path: Path
) -> None:
    """Write a drive that was kept with its forecasts as MCAP.

    Args:
        done: the drive.
        scene: of it, see `as_scene`.
        episode: that was driven.
        method: that forecast.
        protocol: of the forecasts.
        path: of the recording.
    """
    watched_s = episode.watching * done.dt_s
    forecasts = [one for one in done.forecasts if len(one) and one.time_s >= watched_s - 1e-6]
    windows = as_windows(scene, forecasts, method, protocol)
    write_recording(scene, path, windows, {method: _COLOUR}, method)
