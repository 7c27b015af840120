"""`pedpred drive`: a robot drives among the people of a scene, with several forecasters."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from pedpred.command.conversion import layout_of, read_given
from pedpred.driving.episodes import DriveSettings, draw_episode
from pedpred.driving.forecasters import NAMES, TRUTH, forecaster_of
from pedpred.driving.loop import Drive
from pedpred.driving.loop import drive as drive_episode
from pedpred.driving.planner import PlannerSettings
from pedpred.driving.robot import Robot
from pedpred.driving.runs import Runner, checksum, conditions, run
from pedpred.driving.sensor import SensorSettings
from pedpred.driving.table import Condition, Episodes, Row, equal_time, read_table, summary, write_table
from pedpred.errors import StorageError, ValueRuleError
from pedpred.online.replay import as_windows
from pedpred.online.shipped import default_model
from pedpred.ros import write_recording
from pedpred.ros.foxglove import write_layout
from pedpred.scenes import Scene, Trajectories

_log = logging.getLogger(__name__)
_COLOUR = (0.84, 0.37, 0.0)
_SAVED_EVERY = 10  # episodes


def drive(given: argparse.Namespace) -> None:
    """Let a robot drive among the people of a scene with several forecasters, and count collisions."""
    settings = DriveSettings(
        robot=Robot(given.robot, given.radius_m, given.speed_mps),
        planner=PlannerSettings(),
        sensor=SensorSettings(given.range_m, np.deg2rad(given.view_deg), given.noise_m, given.missed),
        seed=given.seed,
    )
    model = given.model or default_model()
    scene = read_given(given)
    methods, risks = given.method or NAMES, given.risk or [0.02, 0.1, 0.3]
    asked = conditions(methods, risks)
    if given.record is not None:
        _record(scene, settings, model, asked[0], given)
        return
    rows = _known(given.table, checksum(scene, settings, model))
    done = {(row.episode, row.condition) for row in rows}
    wanted = {
        number: missing
        for number in range(given.episodes)
        if (missing := [one for one in asked if (number, one) not in done])
    }
    cycles: list[float] = []
    drives = run(scene, settings, model, wanted, given.processes)
    try:
        for new, own_s in tqdm(drives, total=len(wanted), desc=f"drive {scene.name}", unit="episode"):
            rows, cycles = rows + new, cycles + own_s
            if len(cycles) // len(asked) % _SAVED_EVERY == 0:
                write_table(given.table, rows)
    finally:
        write_table(given.table, rows)
    rows = [row for row in rows if row.condition in asked and row.episode < given.episodes]
    sys.stdout.write(summary(rows))
    sys.stdout.write(_compared(rows))
    if cycles:
        _log.info("forecast and plan: %.1f ms a cycle (median)", 1e3 * float(np.median(cycles)))


def _known(path: Path, settings: str) -> list[Row]:
    """Rows of earlier runs.

    Raises:
        StorageError: they are of another recording, robot or model.
    """
    rows = read_table(path) if path.exists() else []
    if any(row.settings != settings for row in rows):
        problem = "its drives are of another recording, map, robot, sensor, seed, model or version"
        raise StorageError(path, "settings", problem, "Name another table (--table), or remove this one")
    return rows


def _compared(rows: Sequence[Row]) -> str:
    """A line that compares modes with the Kalman filter at equal time, if both have curves."""
    found = equal_time(Episodes.of(rows), "modes", "kalman")
    if found is None:
        return ""
    time_s, apart, low, high = found
    return (
        f"modes minus kalman, at {time_s:.2f} s to the goal: {100 * apart:+.1f} % of the episodes with a "
        f"collision at fault (95 % interval {100 * low:+.1f} to {100 * high:+.1f})\n"
    )


def _record(
    scene: Scene, settings: DriveSettings, model: Path, condition: Condition, given: argparse.Namespace
) -> None:
    """Write one episode as MCAP: the people, the robot as the track with the largest id, and forecasts."""
    settings = replace(settings, planner=replace(settings.planner, risk=condition.risk))
    runner = Runner(scene, settings, model)
    place, predictor = runner.place, runner.predictor
    asked = settings.robot, settings.planner, settings.episodes
    episode = draw_episode(place, given.episode, settings.seed, *asked)
    forecaster = forecaster_of(condition.method, predictor, place.occupancy, episode.window)
    done = drive_episode(episode, forecaster, place.occupancy, settings, keep=True)
    watched = episode.watching * done.dt_s
    seen = replace(scene, trajectories=_with_robot(done, episode.window.track_id, watched))
    forecasts = [one for one in done.forecasts if len(one) and one.time_s >= watched - 1e-6]
    windows = as_windows(seen, forecasts, condition.method, predictor.protocol)
    write_recording(seen, given.record, windows, {condition.method: _COLOUR}, condition.method)
    write_layout(seen.occupancy, set(), layout_of(given.record))
    _log.info("%s: episode %d, %s, in %s", scene.name, given.episode, condition.method, given.record)


def _with_robot(done: Drive, track_id: np.ndarray, start_s: float) -> Trajectories:
    """The true people of a drive and its robot."""
    tick, who = np.nonzero(np.isfinite(done.people[..., 0]))
    own = np.arange(len(done.state))
    robot = int(track_id.max(initial=0)) + 1
    return Trajectories(
        start_s + np.concatenate([tick, own]) * done.dt_s,
        np.concatenate([track_id[who], np.full(len(own), robot)]),
        np.concatenate([done.people[tick, who], done.state[:, :2]]),
    )


def check_drive(given: argparse.Namespace) -> None:
    """Check what only `pedpred drive` needs.

    Raises:
        ValueRuleError: a recording has another suffix than .mcap, or is one of the true future.
    """
    if given.table is None:
        given.table = Path(f"{given.scene.stem}_drives.csv")
    if given.record is None:
        return
    if given.record.suffix != ".mcap":
        raise ValueRuleError("--record", str(given.record), "the name of a recording ends in .mcap")
    given.method = given.method or ["modes"]
    if given.method[0] == TRUTH:
        raise ValueRuleError("--method", TRUTH, "it makes no forecasts that a recording holds")
