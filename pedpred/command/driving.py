"""`pedpred drive`: a robot drives among recorded or simulated people, with several forecasters."""

from __future__ import annotations

import argparse
import logging
import sys
import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from tqdm import tqdm

from pedpred.command.conversion import layout_of, read_given
from pedpred.driving.episodes import DriveSettings, Recording
from pedpred.driving.forecasters import NAMES, TRUTH
from pedpred.driving.loop import Drive
from pedpred.driving.planner import PlannerSettings
from pedpred.driving.robot import Robot
from pedpred.driving.runs import Places, Runner, checksum, conditions, run
from pedpred.driving.sensor import SensorSettings
from pedpred.driving.table import Condition, Episodes, Row, equal_time, read_table, summary, write_table
from pedpred.driving.worlds import REACTIONS, Worlds
from pedpred.errors import OutputError, StorageError, ValueRuleError
from pedpred.online.replay import as_windows
from pedpred.online.shipped import default_model
from pedpred.ros import write_recording
from pedpred.ros.foxglove import write_layout
from pedpred.scenes import Scene, Trajectories

_log = logging.getLogger(__name__)
_COLOUR = (0.84, 0.37, 0.0)
_SAVED_EVERY_S = 10.0
_RISKS = (0.02, 0.05, 0.1, 0.2, 0.4)


def drive(given: argparse.Namespace) -> None:
    """Let a robot drive among the people of a scene, or of simulated worlds, and count collisions."""
    settings = DriveSettings(
        robot=Robot(given.robot, given.radius_m, given.speed_mps),
        planner=PlannerSettings(),
        sensor=SensorSettings(given.range_m, np.deg2rad(given.view_deg), given.noise_m, given.missed),
        seed=given.seed,
        shown=given.shown,
    )
    model = given.model or default_model()
    places: Places = Recording(read_given(given)) if given.world is None else _worlds(given)
    asked = conditions(given.method or NAMES, given.risk or _RISKS)
    if given.record is not None:
        _record(Runner(places, settings, model), asked, given)
        return
    rows = _known(given.table, checksum(places, settings, model))
    done = {(row.episode, row.condition) for row in rows}
    wanted = {
        number: missing
        for number in range(given.episodes)
        if (missing := [one for one in asked if (number, one) not in done])
    }
    cycles: list[float] = []
    drives = run(places, settings, model, wanted, given.processes)
    saved_s = time.monotonic()
    try:
        for new, own_s in tqdm(drives, total=len(wanted), desc=f"drive {places.name}", unit="episode"):
            rows, cycles = rows + new, cycles + own_s
            if time.monotonic() - saved_s > _SAVED_EVERY_S:
                write_table(given.table, rows)
                saved_s = time.monotonic()
    finally:
        write_table(given.table, rows)
    rows = [row for row in rows if row.condition in asked and row.episode < given.episodes]
    sys.stdout.write(summary(rows))
    sys.stdout.write(_compared(rows))
    if given.curves is not None:
        from pedpred.driving.pictures import curves_figure  # heavy, and for pictures alone
        from pedpred.report.canvas import write_png

        write_png(curves_figure(rows), given.curves)
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


def _record(runner: Runner, asked: Sequence[Condition], given: argparse.Namespace) -> None:
    """Write one episode: a picture of all conditions, or an MCAP of the first one.

    The MCAP holds the people, the robot as the track with the largest id, and forecasts.
    """
    place, episode = runner.places.draw(given.episode, runner.settings)
    if given.record.suffix == ".png":
        from pedpred.driving.pictures import episode_figure  # heavy, and for pictures alone
        from pedpred.report.canvas import write_png

        drives = {one: runner.driven(place, episode, one) for one in asked}
        write_png(episode_figure(place, episode, drives, runner.settings.robot), given.record)
        return
    done = runner.driven(place, episode, asked[0], keep=True)
    watched, method = episode.watching * done.dt_s, asked[0].method
    seen = Scene(place.name, _with_robot(done, episode.crowd().track_id, watched), place.occupancy, done.dt_s)
    forecasts = [one for one in done.forecasts if len(one) and one.time_s >= watched - 1e-6]
    windows = as_windows(seen, forecasts, method, runner.predictor.protocol)
    write_recording(seen, given.record, windows, {method: _COLOUR}, method)
    write_layout(seen.occupancy, set(), layout_of(given.record))
    _log.info("%s: episode %d, %s, in %s", place.name, given.episode, method, given.record)


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


def _worlds(given: argparse.Namespace) -> Worlds:
    return Worlds(given.world, given.people == REACTIONS[0])


def check_drive(given: argparse.Namespace) -> None:
    """Check what only `pedpred drive` needs.

    Raises:
        ValueRuleError: both a scene and a world are named, or neither; a recording has another suffix than
            .mcap or .png, or is one of the true future; a picture is no .png.
        OutputError: a picture is asked for, but matplotlib is not installed.
    """
    if (given.scene is None) == (given.world is None):
        raise ValueRuleError("scene", str(given.scene), "name either a scene or --world")
    if given.table is None:
        name = given.scene.stem if given.world is None else _worlds(given).name
        given.table = Path(f"{name}_drives.csv")
    if given.curves is not None and given.curves.suffix != ".png":
        raise ValueRuleError("--curves", str(given.curves), "the name of a picture ends in .png")
    pictures = [path for path in (given.curves, given.record) if path is not None and path.suffix == ".png"]
    if pictures and find_spec("matplotlib") is None:
        remedy = 'Install it: pip install "pedpred[pictures]"'
        raise OutputError(pictures[0], "pictures need matplotlib", remedy)
    if given.record is None:
        return
    if given.record.suffix not in (".mcap", ".png"):
        raise ValueRuleError("--record", str(given.record), "its name ends in .mcap or .png")
    picture = given.record.suffix == ".png"
    given.method = given.method or (["kalman", "modes", TRUTH] if picture else ["modes"])
    given.risk = given.risk or [0.1]
    if not picture and given.method[0] == TRUTH:
        raise ValueRuleError("--method", TRUTH, "it makes no forecasts that a recording holds")
