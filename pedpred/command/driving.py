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
from pedpred.command.options import option_of
from pedpred.command.recordings import OPEN_FIELDS, open_scene, warn_without_obstacles
from pedpred.driving.episodes import DriveSettings
from pedpred.driving.figures import figures_of, summary
from pedpred.driving.forecasters import NAMES, TRUTH
from pedpred.driving.places import REACTIONS, Places, Recording, Worlds
from pedpred.driving.planner import PlannerSettings, check_braking
from pedpred.driving.robot import Robot
from pedpred.driving.runs import Models, Runner, checksum, run
from pedpred.driving.sensor import RobotSensor
from pedpred.driving.shown import as_scene, describe, write_drive
from pedpred.driving.table import Condition, Row, read_table, write_table
from pedpred.errors import InputError, OutputError, ValueRuleError
from pedpred.online.shipped import default_model

TABLE_DEFAULTS = {"table": None, "episodes": 100, "processes": 1, "curves": None}
"""Options about a table of drives, which have no meaning for the record of one episode."""
_PICTURE = ".png"
_SAVED_EVERY_S = 10.0
_RISKS = (0.02, 0.05, 0.1, 0.2, 0.4)
_log = logging.getLogger(__name__)


def check_drive(arguments: argparse.Namespace) -> None:
    """Check what only `pedpred drive` needs, and complete the arguments.

    Raises:
        ValueRuleError: both a scene and a world are named, or neither; an option has no meaning beside
            another one; the robot brakes for longer than a manoeuvre lasts; two networks have one name; an
            output has another suffix than its kind, or a recording is to hold several drives.
        OutputError: a picture is asked for, but matplotlib is not installed.
    """
    if (arguments.scene is None) == (arguments.world is None):
        raise ValueRuleError("scene", str(arguments.scene), "name either a scene or --world")
    beside_place = ("a recording", ["reaction"]) if arguments.world is None else ("--world", OPEN_FIELDS)
    beside_output = ("--record", TABLE_DEFAULTS) if arguments.record else ("a table of drives", ["episode"])
    for other, unused in (beside_place, beside_output):
        for name in unused:
            if (value := getattr(arguments, name, None)) is not None:
                raise ValueRuleError(
                    option_of(name), str(value), f"it has no meaning beside {other}: omit it"
                )
    if arguments.record is not None:
        _complete_record(arguments)
    for name, usual in TABLE_DEFAULTS.items():
        vars(arguments).setdefault(name, usual)
    if arguments.table is None and arguments.record is None:
        name = stem_of(arguments.scene) if arguments.world is None else _worlds(arguments).name
        arguments.table = Path(f"{name}_drives.csv")
    check_braking(_robot(arguments), PlannerSettings())
    _models(arguments)
    _check_pictures(arguments)


def _complete_record(arguments: argparse.Namespace) -> None:
    """Check that the episode can be recorded, and choose what is not given."""
    is_picture = arguments.record.suffix == _PICTURE
    if arguments.record.suffix not in (MCAP, _PICTURE):
        raise ValueRuleError("--record", str(arguments.record), "its name ends in .mcap or .png")
    arguments.method = arguments.method or (["kalman", "modes", TRUTH] if is_picture else ["modes"])
    arguments.risk = arguments.risk or [0.1]
    arguments.episode = arguments.episode or 0
    if is_picture:
        return
    if arguments.method[0] == TRUTH:
        raise ValueRuleError("--method", TRUTH, f"{TRUTH} has no forecasts to record")
    drives = _models(arguments).conditions(arguments.method, arguments.risk)
    if len(drives) > 1:
        several = ", ".join(f"{one.method} at {one.risk:g}" for one in drives)
        rule = "it holds one drive: give one --method and one --risk, no --compare, or a name with .png"
        raise ValueRuleError("--record", several, rule)


def _check_pictures(arguments: argparse.Namespace) -> None:
    if arguments.curves is not None and arguments.curves.suffix != _PICTURE:
        raise ValueRuleError("--curves", str(arguments.curves), "the name of a picture ends in .png")
    pictures = [path for path in (arguments.curves, arguments.record) if path and path.suffix == _PICTURE]
    if pictures and find_spec("matplotlib") is None:
        remedy = 'Install it: pip install "pedpred[pictures]"'
        raise OutputError(pictures[0], "pictures need matplotlib", remedy)


def drive(arguments: argparse.Namespace) -> None:
    """Let a robot drive among the people of a scene, or of simulated worlds, and count collisions."""
    view_rad = np.deg2rad(arguments.view_deg)
    settings = DriveSettings(
        robot=_robot(arguments),
        planner=PlannerSettings(),
        sensor=RobotSensor(arguments.range_m, view_rad, arguments.noise_m, arguments.missed),
        seed=arguments.seed,
        shown=arguments.shown,
    )
    models = _models(arguments)
    places: Places = _recording(arguments) if arguments.world is None else _worlds(arguments)
    asked = models.conditions(arguments.method or NAMES, arguments.risk or _RISKS)
    if arguments.record is not None:
        _record(Runner(places, settings, models), asked, arguments)
    else:
        _fill_table(places, settings, models, asked, arguments)


def _fill_table(
    places: Places,
    settings: DriveSettings,
    models: Models,
    asked: Sequence[Condition],
    arguments: argparse.Namespace,
) -> None:
    """Drive what is missing in the table, add it, and print the figures."""

    def keep() -> None:
        if rows:  # another run may have added drives to the table meanwhile
            mine = {(row.episode, row.condition) for row in rows}
            others = [row for row in known() if (row.episode, row.condition) not in mine]
            write_table(arguments.table, rows + others)

    def known() -> list[Row]:
        return _read_known(arguments.table, places, settings, models)

    rows = known()
    done = {(row.episode, row.condition) for row in rows}
    wanted = {
        number: missing
        for number in range(arguments.episodes)
        if (missing := [one for one in asked if (number, one) not in done])
    }
    cycles: list[float] = []
    drives = run(places, settings, models, wanted, arguments.processes)
    saved_s = time.monotonic()
    try:
        for new, own_s in tqdm(drives, total=len(wanted), desc=f"drive {places.name}", unit="episode"):
            rows, cycles = rows + new, cycles + own_s
            if time.monotonic() - saved_s > _SAVED_EVERY_S:
                keep()
                saved_s = time.monotonic()
    finally:
        keep()
    figures = figures_of([row for row in rows if row.condition in asked and row.episode < arguments.episodes])
    sys.stdout.write(summary(figures))
    if arguments.curves is not None:
        from pedpred.report.canvas import write_png  # heavy, and for pictures alone
        from pedpred.report.drives import curves_figure

        write_png(curves_figure(figures), arguments.curves)
    if cycles:
        _log.info("forecast and plan: %.1f ms a cycle (median)", 1e3 * float(np.median(cycles)))


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


def _record(runner: Runner, asked: Sequence[Condition], arguments: argparse.Namespace) -> None:
    """Write one episode: a picture of all conditions, or an MCAP of the first one.

    The MCAP holds the people, the robot as the track with the largest id, and forecasts.
    """
    place, episode = runner.places.draw(arguments.episode, runner.settings)
    if arguments.record.suffix == _PICTURE:
        from pedpred.report.canvas import write_png  # heavy, and for pictures alone
        from pedpred.report.drives import episode_figure

        robot, shown = runner.settings.robot, []
        for one in asked:
            done = runner.driven(place, episode, one)
            shown.append((as_scene(done, place, episode), describe(done, episode, one, robot)))
        write_png(episode_figure(shown), arguments.record)
        return
    done, method = runner.driven(place, episode, asked[0], keep=True), asked[0].method
    seen = as_scene(done, place, episode)
    write_drive(done, seen, episode, method, runner.predictor.protocol, arguments.record)
    write_layout_beside(arguments.record, seen)
    _log.info("%s: episode %d, %s, in %s", place.name, arguments.episode, method, arguments.record)


def _robot(arguments: argparse.Namespace) -> Robot:
    return Robot(arguments.robot, arguments.radius_m, arguments.speed_mps)


def _models(arguments: argparse.Namespace) -> Models:
    """The networks.

    Raises:
        ValueRuleError: two of them have one name, or a name is not one of a network.
    """
    others: dict[str, Path] = {}
    for name, folder in arguments.compare or ():
        if name in others:
            raise ValueRuleError("--compare", name, f"it is the name of {others[name]}: rename {folder}")
        others[name] = folder
    return Models(arguments.model or default_model(), others)


def _recording(arguments: argparse.Namespace) -> Recording:
    scene = open_scene(arguments.scene, arguments.options)
    warn_without_obstacles(scene, arguments.options)
    return Recording(scene)


def _worlds(arguments: argparse.Namespace) -> Worlds:
    return Worlds(arguments.world, (arguments.reaction or REACTIONS[0]) == REACTIONS[0])
