"""Arguments of `pedpred`, and the checks of inputs and outputs that all commands share."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pedpred
from pedpred import command as package
from pedpred.command.conversion import check_conversion, convert, info, output_paths
from pedpred.command.driving import check_drive, drive
from pedpred.command.evaluation import check_evaluation, evaluate
from pedpred.command.field_protocol import PROTOCOL
from pedpred.command.options import open_options, recording_options
from pedpred.command.prediction import check_prediction, predict
from pedpred.command.warming import add_model, add_warm_up
from pedpred.driving.forecasters import NAMES
from pedpred.driving.places import KINDS as WORLDS
from pedpred.driving.places import REACTIONS
from pedpred.driving.robot import KINDS, Robot
from pedpred.driving.sensor import RobotSensor
from pedpred.errors import OutputError
from pedpred.evaluation import EvaluationSettings
from pedpred.files import check_input, check_output
from pedpred.online.network import read_description
from pedpred.reading import FORMATS
from pedpred.settings import LARGEST_SEED, In

_SCENE = (
    "a scene folder, a ROS bag, a recording of this project (.mcap), a table (text, Parquet, Feather) with "
    "time, id, x, y, a text with id, frame, x, y as PeTrack, JuPedSim and PedPy write it, or frame, id, x, y "
    f"as for SGAN, or one of these files: {', '.join(reader.NAME for reader in FORMATS)}"
)
_TRACKER = "a YAML file with acceleration_noise, position_noise_m and initial_speed_mps, as in conf/trackers"
_OUTPUTS = ("output", "json", "table", "curves", "record")
_OVERWRITTEN = ("json", "table", "curves")
"""Outputs that need no `--force`: what a command adds to, or makes again from the same inputs."""
_LIMITS = {
    "grid": In("[0.01, 10]"),
    "step_s": In("[0.01, 10]"),
    "seed": In(f"[0, {LARGEST_SEED}]"),
    "risk": In("[0, 0.99]"),
    "view_deg": In("[1, 360]"),
    "episodes": In("[1, 1000000]"),
    "episode": In("[0, 1000000]"),
    "processes": In("[1, 1000]"),
}
"""Limits of numbers that are in no settings."""


def parser() -> argparse.ArgumentParser:
    """Make the arguments of all subcommands."""
    top = argparse.ArgumentParser(prog="pedpred", description=package.__doc__)
    top.add_argument("--version", action="version", version=f"pedpred {pedpred.__version__}")
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    _add(commands, info, scenes="+")
    target = "an MCAP file (.mcap) or a new scene folder"
    _add_output(_add(commands, convert, check_conversion), target, required=True)
    _add_prediction(_add(commands, predict, check_prediction))
    _add_evaluation(_add(commands, evaluate, check_evaluation, scenes="+"))
    _add_driving(_add(commands, drive, check_drive, scenes="?"))
    add_model(add_warm_up(commands))
    return top


def check(arguments: argparse.Namespace) -> None:
    """Check what can be checked before work begins: inputs exist, outputs can be written.

    Adds `options`, how recordings are opened.

    Raises:
        PedpredError: something is wrong with an argument.
    """
    given = vars(arguments)
    inputs = [path for name in given.keys() - {*_OUTPUTS} for path in _paths(given[name])]
    for path in inputs:
        check_input(path)
    for name, limit in _LIMITS.items():
        for number in _each(given.get(name)):
            limit.check(name, number, "a number")
    arguments.options = open_options(arguments)
    arguments.check(arguments)
    if given.get("model") is not None:
        read_description(given["model"])
    used = {path.resolve() for path in inputs}
    for name in _OUTPUTS:
        for path in [written for output in _paths(given.get(name)) for written in output_paths(output)]:
            check_output(path, folder=name == "output" and not path.suffix)
            if path.resolve() in used:
                raise OutputError(path, "it is an input of this command, or another output")
            if name not in _OVERWRITTEN and not arguments.force and (path.exists() or path.is_symlink()):
                raise OutputError(path, "it is there already", "Replace it with --force, or name another")
            used.add(path.resolve())


def _each(value: Any) -> list[Any]:
    """The values of an argument that is not given, or is given once or several times."""
    if isinstance(value, list | tuple):
        return [one for part in value for one in _each(part)]
    return [] if value is None else [value]


def _paths(value: Any) -> list[Path]:
    return [one for one in _each(value) if isinstance(one, Path)]


def _add(
    commands: Any,
    action: Callable[[argparse.Namespace], None],
    check: Callable[[argparse.Namespace], None] = lambda arguments: None,
    scenes: str | None = None,
) -> argparse.ArgumentParser:
    """Add a subcommand named after its function, which reads one recording or several.

    Args:
        commands: the subparsers.
        action: runs the command.
        check: of its arguments, before work begins; may complete them.
        scenes: how many recordings there are, as `nargs`.
    """
    about = action.__doc__
    command: argparse.ArgumentParser = commands.add_parser(
        action.__name__,
        help=about,
        description=about,
        parents=[recording_options()],
        conflict_handler="resolve",  # `drive` has an option --people of its own
    )
    command.set_defaults(action=action, check=check)
    command.add_argument("scene", type=Path, nargs=scenes, help=_SCENE)
    return command


def _add_number(command: Any, name: str, usual: float, what: str, **more: Any) -> None:
    """Add an option that is a number of the kind of its default."""
    help_text = f"{what} (default {usual:g})"
    command.add_argument(name, type=type(usual), default=usual, help=help_text, **more)


def _add_output(command: argparse.ArgumentParser, what: str, required: bool = False) -> None:
    command.add_argument("-o", "--output", type=Path, required=required, help=what)
    command.add_argument("--force", action="store_true", help="replace an existing file")


def _add_network(command: argparse.ArgumentParser) -> None:
    add_model(command)
    alone = "forecasts of the network alone: learn neither how far to trust it nor its errors nearby"
    command.add_argument("--no-trust", dest="trust", action="store_false", help=alone)


def _add_prediction(command: argparse.ArgumentParser) -> None:
    where = "an MCAP file, or .csv, .parquet (default: NAME_forecasts.mcap in the current folder)"
    _add_output(command, where)
    _add_network(command)
    command.add_argument("--tracker", type=Path, help=_TRACKER)
    grid = "also write the predicted occupancy of every step, in cells of this size, m"
    command.add_argument("--grid", type=float, metavar="M", help=grid)
    noise = "standard deviation of a detection's coordinate, which ellipses are not to include, m"
    _add_number(command, "--detection-noise-m", 0.0, noise)


def _add_evaluation(command: argparse.ArgumentParser) -> None:
    _add_network(command)
    add, usual = command.add_argument, EvaluationSettings()
    add("--tracker", type=Path, help=f"of the network: {_TRACKER}")
    windows = (
        "as the literature on ETH and UCY measures: 8 annotations at 0.4 s are observed, 12 are forecast"
    )
    add("--protocol", choices=[PROTOCOL], help=windows)
    add("--alone", action="store_true", help="forecast each person without the other people")
    theirs = "also measure forecasts of other programs: a table (.csv, .parquet) with track, time, mode, "
    theirs += "weight, step, x, y, or the .ndjson predictions of TrajNet++; may be repeated"
    add("--forecasts", type=Path, action="append", default=[], metavar="FILE", help=theirs)
    step = "time between two steps of the tables of --forecasts, s (default: that of the windows)"
    add("--step-s", type=float, help=step)
    add("--json", type=Path, help="write all metrics to this JSON file")
    _add_number(command, "--moving-mps", usual.moving_mps, "people slower than this count as standing, m/s")
    _add_number(command, "--collision-m", usual.collision_m, "forecast paths closer than this collide, m")
    _add_number(command, "--samples", usual.bootstrap, "bootstrap replicates", dest="bootstrap")
    _add_number(command, "--seed", usual.seed, "seed of the bootstrap")


def _add_driving(command: argparse.ArgumentParser) -> None:
    add, robot, sensor = command.add_argument, Robot(), RobotSensor()
    world = "drive in simulated worlds of this kind, a new one for each episode, instead of a scene"
    add("--world", choices=WORLDS, help=world)
    reaction = "whether simulated people react to the robot or ignore it (default react)"
    add("--people", dest="reaction", choices=REACTIONS, help=reaction)
    shown = "give the robot's position to the forecaster, as that of one more person"
    add("--shown", action="store_true", help=shown)
    add("--method", choices=NAMES, action="append", help="forecaster; may be repeated (default: all)")
    limit = "largest probabilities that the robot overlaps a person (default 0.02 0.05 0.1 0.2 0.4)"
    add("--risk", type=float, action="extend", nargs="+", metavar="P", help=limit)
    _add_number(command, "--seed", 0, "seed of episodes and sensor")
    add_model(command)
    other = "also drive with all modes of this model folder, under this name in the table; may be repeated"
    add("--compare", type=_named, action="append", default=[], metavar="NAME=FOLDER", help=other)
    add("--robot", choices=KINDS, default=robot.kind, help=f"kind of robot (default {robot.kind})")
    _add_number(command, "--radius-m", robot.radius_m, "radius of the robot, m")
    _add_number(command, "--speed-mps", robot.speed_mps, "largest speed of the robot, m/s")
    _add_number(command, "--range-m", sensor.range_m, "range of the sensor, m")
    _add_number(command, "--view-deg", 360.0, "field of view of the sensor, degrees")
    _add_number(command, "--noise-m", sensor.noise_m, "standard deviation of a detection's coordinate, m")
    _add_number(command, "--missed", sensor.missed, "share of missing detections")
    add = command.add_argument_group("a table of drives").add_argument
    file = "file of results; drives in it are not repeated (default: NAME_drives.csv in the current folder)"
    add("--table", type=Path, metavar="CSV", help=file)
    add("--episodes", type=int, help="number of episodes (default 100)")
    add("--processes", type=int, default=1, help="worker processes (default 1)")
    picture = "draw collisions over the time to the goal into this file, a curve for each method"
    add("--curves", type=Path, metavar="NAME.png", help=picture)
    add = command.add_argument_group("one episode").add_argument
    record = "only write one episode: as MCAP with one method (default: modes), or as a picture of several"
    add("--record", type=Path, metavar="NAME.mcap|NAME.png", help=record)
    add("--episode", type=int, help="number of the episode to record (default 0)")
    add("--force", action="store_true", help="replace an existing recording")


def _named(text: str) -> tuple[str, Path]:
    """A folder, and the name of its network."""
    name, sign, folder = text.partition("=")
    if not (name and sign):
        raise argparse.ArgumentTypeError(f"{text!r}: write a name, = and a folder")
    return name, Path(folder)
