"""`pedpred drive`: a robot drives among recorded or simulated people, with several forecasters."""

from __future__ import annotations

import argparse
import logging
import sys
import time
from collections.abc import Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from tqdm import tqdm

from pedpred.command.conversion import (
    layout_of,
    options_for_fields,
    read_given,
    stem_of,
    warn_without_obstacles,
)
from pedpred.driving.episodes import DriveSettings, Recording
from pedpred.driving.figures import figures_of, summary
from pedpred.driving.forecasters import NAMES, TRUTH
from pedpred.driving.planner import PlannerSettings, check_braking
from pedpred.driving.robot import Robot
from pedpred.driving.runs import Models, Places, Runner, checksum, run
from pedpred.driving.sensor import SensorSettings
from pedpred.driving.shown import as_scene, describe, write_drive
from pedpred.driving.table import Condition, Row, read_table, write_table
from pedpred.driving.worlds import REACTIONS, Worlds
from pedpred.errors import InputError, OutputError, ValueRuleError
from pedpred.online.shipped import default_model
from pedpred.ros.foxglove import write_layout

_log = logging.getLogger(__name__)
_SAVED_EVERY_S = 10.0
_RISKS = (0.02, 0.05, 0.1, 0.2, 0.4)


def drive(arguments: argparse.Namespace) -> None:
    """Let a robot drive among the people of a scene, or of simulated worlds, and count collisions."""
    settings = DriveSettings(
        robot=Robot(arguments.robot, arguments.radius_m, arguments.speed_mps),
        planner=PlannerSettings(),
        sensor=SensorSettings(
            arguments.range_m, np.deg2rad(arguments.view_deg), arguments.noise_m, arguments.missed
        ),
        seed=arguments.seed,
        shown=arguments.shown,
    )
    models = _models(arguments)
    places: Places = _recording(arguments) if arguments.world is None else _worlds(arguments)
    asked = models.conditions(arguments.method or NAMES, arguments.risk or _RISKS)
    if arguments.record is not None:
        _record(Runner(places, settings, models), asked, arguments)
        return
    known = partial(_known, arguments.table, places, settings, models)
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
                write_table(arguments.table, _joined(rows, known()))
                saved_s = time.monotonic()
    finally:
        if rows:
            write_table(arguments.table, _joined(rows, known()))
    rows = [row for row in rows if row.condition in asked and row.episode < arguments.episodes]
    figures = figures_of(rows)
    sys.stdout.write(summary(figures))
    if arguments.curves is not None:
        from pedpred.report.canvas import write_png  # heavy, and for pictures alone
        from pedpred.report.drives import curves_figure

        write_png(curves_figure(figures), arguments.curves)
    if cycles:
        _log.info("forecast and plan: %.1f ms a cycle (median)", 1e3 * float(np.median(cycles)))


def _known(path: Path, places: Places, settings: DriveSettings, models: Models) -> list[Row]:
    """Rows of earlier runs, and of others that go on beside this one.

    Raises:
        InputError: they are of another recording, robot or model, or of a network that is not named.
    """
    rows = read_table(path) if path.exists() else []
    if unnamed := sorted({row.condition.method for row in rows} - {*NAMES, *models.others}):
        problem = f"it has drives of {', '.join(unnamed)}, a network that is not named now"
        raise InputError(path, "method", problem, "Name its folder (--compare), or another table (--table)")
    sums = {
        method: checksum(places, settings, models.of(method)) for method, _ in {r.condition for r in rows}
    }
    if any(row.settings != sums[row.condition.method] for row in rows):
        problem = "its drives are of another recording, map, robot, sensor, seed, model or version"
        raise InputError(path, "settings", problem, "Name another table (--table), or remove this one")
    return rows


def _joined(rows: list[Row], others: list[Row]) -> list[Row]:
    """Rows, and those that another run has added to the table meanwhile."""
    mine = {(row.episode, row.condition) for row in rows}
    return rows + [row for row in others if (row.episode, row.condition) not in mine]


def _record(runner: Runner, asked: Sequence[Condition], arguments: argparse.Namespace) -> None:
    """Write one episode: a picture of all conditions, or an MCAP of the first one.

    The MCAP holds the people, the robot as the track with the largest id, and forecasts.
    """
    place, episode = runner.places.draw(arguments.episode, runner.settings)
    if arguments.record.suffix == ".png":
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
    write_layout(seen.occupancy, set(), layout_of(arguments.record))
    _log.info("%s: episode %d, %s, in %s", place.name, arguments.episode, method, arguments.record)


def _models(arguments: argparse.Namespace) -> Models:
    """The networks.

    Raises:
        ValueRuleError: two of them have one name, or a name is none of a network.
    """
    others: dict[str, Path] = {}
    for name, folder in arguments.compare or ():
        if name in others:
            raise ValueRuleError("--compare", name, f"{others[name]} is called so: name {folder} otherwise")
        others[name] = folder
    return Models(arguments.model or default_model(), others)


def _recording(arguments: argparse.Namespace) -> Recording:
    scene = read_given(arguments)
    warn_without_obstacles(scene, arguments)
    return Recording(scene)


def _worlds(arguments: argparse.Namespace) -> Worlds:
    return Worlds(arguments.world, (arguments.people or REACTIONS[0]) == REACTIONS[0])


def check_drive(arguments: argparse.Namespace) -> None:
    """Check what only `pedpred drive` needs.

    Raises:
        ValueRuleError: both a scene and a world are named, or neither; an option has no meaning for what is
            named; the robot brakes for longer than a manoeuvre lasts; a recording has another suffix than
            .mcap or .png, or is of the true future or several drives; a picture is no .png or has the name of
            the table.
        OutputError: a picture is asked for, but matplotlib is not installed.
    """
    if (arguments.scene is None) == (arguments.world is None):
        raise ValueRuleError("scene", str(arguments.scene), "name either a scene or --world")
    _check_meaning(arguments)
    robot = Robot(arguments.robot, arguments.radius_m, arguments.speed_mps)
    with options_for_fields({"--speed-mps": "speed_mps"}):
        check_braking(robot, PlannerSettings())
    if arguments.table is None and arguments.record is None:
        name = stem_of(arguments.scene) if arguments.world is None else _worlds(arguments).name
        arguments.table = Path(f"{name}_drives.csv")
    _check_pictures(arguments)
    if arguments.record is not None:
        _check_record(arguments)


def _check_pictures(arguments: argparse.Namespace) -> None:
    """Check that pictures can be drawn, and the curves replace no table; errors of `check_drive`."""
    if arguments.curves is not None and arguments.curves.suffix != ".png":
        raise ValueRuleError("--curves", str(arguments.curves), "the name of a picture ends in .png")
    if arguments.curves is not None and arguments.curves.resolve() == arguments.table.resolve():
        raise ValueRuleError("--curves", str(arguments.curves), "it is the table of drives: name another")
    pictures = [
        path for path in (arguments.curves, arguments.record) if path is not None and path.suffix == ".png"
    ]
    if pictures and find_spec("matplotlib") is None:
        remedy = 'Install it: pip install "pedpred[pictures]"'
        raise OutputError(pictures[0], "pictures need matplotlib", remedy)


def _check_record(arguments: argparse.Namespace) -> None:
    """Check that the episode can be recorded, and choose what is not said; errors of `check_drive`."""
    if arguments.record.suffix not in (".mcap", ".png"):
        raise ValueRuleError("--record", str(arguments.record), "its name ends in .mcap or .png")
    picture = arguments.record.suffix == ".png"
    arguments.method = arguments.method or (["kalman", "modes", TRUTH] if picture else ["modes"])
    arguments.risk = arguments.risk or [0.1]
    if not picture and arguments.method[0] == TRUTH:
        raise ValueRuleError("--method", TRUTH, "it makes no forecasts that a recording holds")
    models = _models(arguments)
    drives = models.conditions(arguments.method, arguments.risk)
    if not picture and len(drives) > 1:
        several = ", ".join(f"{one.method} at {one.risk:g}" for one in drives)
        rule = "it holds one drive: give one --method and one --risk{}, or a name that ends in .png"
        rule = rule.format(", and no --compare" if models.others else "")
        raise ValueRuleError("--record", several, rule)
    arguments.episode = arguments.episode or 0


def _check_meaning(arguments: argparse.Namespace) -> None:
    """Check that every option has a meaning.

    Raises:
        ValueRuleError: one has none.
    """
    if arguments.world is None and arguments.people is not None:
        raise ValueRuleError("--people", arguments.people, "people of a recording walk as they did: omit it")
    if arguments.record is None and arguments.episode is not None:
        rule = "it is about --record; --episodes is the number of drives"
        raise ValueRuleError("--episode", arguments.episode, rule)
    without = (
        (arguments.world, arguments.about_recordings, "a recording; --world has none"),
        (arguments.record, arguments.about_tables, "a table of drives; --record writes one episode"),
    )
    for other, about, reason in without:
        for name, (field, usual) in about.items():
            if other is not None and (value := getattr(arguments, field)) != usual:
                raise ValueRuleError(name, str(value), f"it is about {reason}: omit one")
