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

from pedpred.command.conversion import MCAP, stem_of, write_layout_beside
from pedpred.command.recordings import OpenOptions, open_scene, warn_without_obstacles
from pedpred.driving.episodes import DriveSettings
from pedpred.driving.figures import figures_of, summary
from pedpred.driving.forecasters import NAMES, TRUTH
from pedpred.driving.places import REACTIONS, Places, Recording, Worlds
from pedpred.driving.robot import Robot
from pedpred.driving.runs import Models, Runner, checksum, run
from pedpred.driving.sensor import RobotSensor
from pedpred.driving.shown import as_scene, describe, write_drive
from pedpred.driving.table import Condition, Row, read_table, write_table
from pedpred.errors import InputError, OutputError, ValueRuleError
from pedpred.online.shipped import default_model

_PICTURE = ".png"
_SAVED_EVERY_S = 10.0
_RISKS = (0.02, 0.05, 0.1, 0.2, 0.4)
_EPISODES = 100
_log = logging.getLogger(__name__)


def check_drive(arguments: argparse.Namespace) -> None:
    """Check what only `pedpred drive` needs, and complete the arguments.

    Adds `settings` and `models`.

    Raises:
        ValueRuleError: both a scene and a world are named, or neither; options exclude each other; a setting
            of the robot or its sensor is wrong; or an output has another suffix than its kind.
        OutputError: a picture is asked for, but matplotlib is not installed.
    """
    if (arguments.scene is None) == (arguments.world is None):
        raise ValueRuleError("scene", str(arguments.scene), "name either a scene or --world")
    if arguments.world and arguments.options != OpenOptions():
        raise ValueRuleError("world", arguments.world, "it excludes all options of recordings: omit them")
    unused = ["table", "episodes", "curves"] if arguments.record else ["episode"]
    for name in unused if arguments.world else [*unused, "reaction"]:
        if (value := getattr(arguments, name)) is not None:
            rule = "it is about a table of drives, one episode (--record) or --world: omit it"
            raise ValueRuleError(name, str(value), rule)
    robot = Robot(arguments.robot, arguments.radius_m, arguments.speed_mps)
    view_rad = np.deg2rad(arguments.view_deg)
    sensor = RobotSensor(arguments.range_m, view_rad, arguments.noise_m, arguments.missed)
    arguments.settings = DriveSettings(robot=robot, sensor=sensor, seed=arguments.seed, shown=arguments.shown)
    arguments.models = Models(arguments.model or default_model(), dict(arguments.compare))
    if len(arguments.models.others) < len(arguments.compare):
        raise ValueRuleError("compare", str(arguments.compare), "each network needs a name of its own")
    if arguments.record is not None:
        _complete_record(arguments)
    elif arguments.table is None:
        name = stem_of(arguments.scene) if arguments.world is None else _worlds(arguments).name
        arguments.table = Path(f"{name}_drives.csv")
    if arguments.curves is not None and arguments.curves.suffix != _PICTURE:
        raise ValueRuleError("curves", str(arguments.curves), "the name of a picture ends in .png")
    pictures = [path for path in (arguments.curves, arguments.record) if path and path.suffix == _PICTURE]
    if pictures and find_spec("matplotlib") is None:
        remedy = 'Install it: pip install "pedpred[pictures]"'
        raise OutputError(pictures[0], "pictures need matplotlib", remedy)


def _complete_record(arguments: argparse.Namespace) -> None:
    """Check that the episode can be recorded, and choose what is not given."""
    is_picture = arguments.record.suffix == _PICTURE
    if arguments.record.suffix not in (MCAP, _PICTURE):
        raise ValueRuleError("record", str(arguments.record), "its name ends in .mcap or .png")
    arguments.method = arguments.method or (["kalman", "modes", TRUTH] if is_picture else ["modes"])
    arguments.risk = arguments.risk or [0.1]
    drives = arguments.models.conditions(arguments.method, arguments.risk)
    if not is_picture and (len(drives) > 1 or drives[0].method == TRUTH):
        rule = f"it holds one drive, not of {TRUTH}: give one --method and one --risk, or a name with .png"
        raise ValueRuleError("record", str(arguments.record), rule)


def drive(arguments: argparse.Namespace) -> None:
    """Let a robot drive among the people of a scene, or of simulated worlds, and count collisions."""
    places: Places
    if arguments.world is None:
        scene = open_scene(arguments.scene, arguments.options)
        warn_without_obstacles(scene, arguments.options)
        places = Recording(scene)
    else:
        places = _worlds(arguments)
    settings, models = arguments.settings, arguments.models
    asked = models.conditions(arguments.method or NAMES, arguments.risk or _RISKS)
    if arguments.record is not None:
        _record(Runner(places, settings, models), asked, arguments.episode or 0, arguments.record)
        return
    episodes = _EPISODES if arguments.episodes is None else arguments.episodes
    rows = _fill_table(arguments.table, places, settings, models, asked, episodes, arguments.processes)
    figures = figures_of([row for row in rows if row.condition in asked and row.episode < episodes])
    sys.stdout.write(summary(figures))
    if arguments.curves is not None:
        from pedpred.report.canvas import write_png  # heavy, and for pictures alone
        from pedpred.report.drives import curves_figure

        write_png(curves_figure(figures), arguments.curves)


def _worlds(arguments: argparse.Namespace) -> Worlds:
    return Worlds(arguments.world, (arguments.reaction or REACTIONS[0]) == REACTIONS[0])


def _fill_table(
    path: Path,
    places: Places,
    settings: DriveSettings,
    models: Models,
    asked: Sequence[Condition],
    episodes: int,
    processes: int,
) -> list[Row]:
    """Drive what is missing in a table, and add it, also when the run is interrupted; all its rows."""

    def add(new: list[Row]) -> list[Row]:
        known = _read_known(path, places, settings, models)  # with drives that other runs add meanwhile
        done = {(row.episode, row.condition) for row in known}
        rows = known + [row for row in new if (row.episode, row.condition) not in done]
        if new:
            write_table(path, rows)
        return rows

    done = {(row.episode, row.condition) for row in add([])}
    wanted = {n: [one for one in asked if (n, one) not in done] for n in range(episodes)}
    wanted = {number: missing for number, missing in wanted.items() if missing}
    new: list[Row] = []
    cycles: list[float] = []
    saved_s = time.monotonic()
    drives = run(places, settings, models, wanted, processes)
    try:
        for rows, own_s in tqdm(drives, total=len(wanted), desc=f"drive {places.name}", unit="episode"):
            new, cycles = new + rows, cycles + own_s
            if time.monotonic() - saved_s > _SAVED_EVERY_S:
                add(new)
                saved_s = time.monotonic()
    finally:
        rows = add(new)
    if cycles:
        _log.info("forecast and plan: %.1f ms a cycle (median)", 1e3 * float(np.median(cycles)))
    return rows


def _read_known(path: Path, places: Places, settings: DriveSettings, models: Models) -> list[Row]:
    """Rows of earlier runs, and of others that run at the same time.

    Raises:
        InputError: they are of another recording, robot or model, or of a network that is not named.
    """
    rows = read_table(path) if path.exists() else []
    methods = {row.condition.method for row in rows}
    if unnamed := sorted(methods - {*NAMES, *models.others}):
        problem = f"it has drives of {', '.join(unnamed)}, a network that is not named now"
        raise InputError(path, "method", problem, "Name its folder (--compare), or another table (--table)")
    sums = {method: checksum(places, settings, models.of(method)) for method in methods}
    if any(row.settings != sums[row.condition.method] for row in rows):
        problem = "its drives are of another recording, map, robot, sensor, seed, model or version"
        raise InputError(path, "settings", problem, "Name another table (--table), or remove this one")
    return rows


def _record(runner: Runner, asked: Sequence[Condition], number: int, path: Path) -> None:
    """Write one episode: a picture of all conditions, or an MCAP of the first one.

    The MCAP holds the people, the robot as the track with the largest id, and forecasts.
    """
    place, episode = runner.places.draw(number, runner.settings)
    if path.suffix == _PICTURE:
        from pedpred.report.canvas import write_png  # heavy, and for pictures alone
        from pedpred.report.drives import episode_figure

        shown = []
        for one in asked:
            done = runner.driven(place, episode, one)
            about = describe(done, episode, one, runner.settings.robot)
            shown.append((as_scene(done, place, episode), about))
        write_png(episode_figure(shown), path)
        return
    done, method = runner.driven(place, episode, asked[0], keep=True), asked[0].method
    seen = as_scene(done, place, episode)
    write_drive(done, seen, episode, method, runner.predictor.protocol, path)
    write_layout_beside(path, seen)
    _log.info("%s: episode %d, %s, in %s", place.name, number, method, path)
