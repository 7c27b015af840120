"""Arguments of `pedpred`, and the checks of inputs and outputs that all commands share."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pedpred
from pedpred import command as package
from pedpred.command.conversion import check_conversion, convert, info, written_to
from pedpred.command.driving import TABLE_DEFAULTS, check_drive, drive
from pedpred.command.evaluation import TUNE, check_evaluation, evaluate
from pedpred.command.field_protocol import PROTOCOL
from pedpred.command.options import named_path, open_options, recording_options
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

_SCENE = (
    "a scene folder, a ROS bag, a recording of this project (.mcap), a table (text, Parquet, Feather) with "
    "time, id, x, y, a text with id, frame, x, y as PeTrack, JuPedSim and PedPy write it, or frame, id, x, y "
    f"as for SGAN, or one of these files: {', '.join(reader.NAME for reader in FORMATS)}"
)
_TRACKER = "a YAML file with acceleration_noise, position_noise_m and initial_speed_mps, as in conf/trackers"
_INPUTS = ("scene", "map", "homography", "model", "tracker", "forecasts", "compare")
_OUTPUTS = ("output", "json", "table", "curves", "record")
_OVERWRITTEN = ("json", "table", "curves")
"""Outputs that need no `--force`: what a command adds to, or makes again from the same inputs."""


def parser() -> argparse.ArgumentParser:
    """Make the arguments of all subcommands."""
    top = argparse.ArgumentParser(prog="pedpred", description=package.__doc__)
    top.add_argument("--version", action="version", version=f"pedpred {pedpred.__version__}")
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    _add(commands, info, scenes="+")
    _add_output(
        _add(commands, convert, check_conversion), "an MCAP file (.mcap) or a new scene folder", required=True
    )
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
    inputs = [path for name in _INPUTS for path in _paths(getattr(arguments, name, None))]
    for path in inputs:
        check_input(path)
    arguments.options = open_options(arguments)
    arguments.check(arguments)
    for model in _paths(getattr(arguments, "model", None)):
        read_description(model)
    used = [path.resolve() for path in inputs]
    outputs = [(name, path) for name in _OUTPUTS for path in _paths(getattr(arguments, name, None))]
    for name, output in outputs:
        for path in written_to(output):
            check_output(path, folder=name == "output" and not path.suffix)
            if path.resolve() in used:
                raise OutputError(path, "it is an input of this command, or another output")
            if name not in _OVERWRITTEN and not arguments.force and (path.exists() or path.is_symlink()):
                sys.exit(f"{path} is there already; --force replaces it")
            used.append(path.resolve())


def _paths(value: Any) -> list[Path]:
    """The paths in the value of an argument: one, several, or with names."""
    if isinstance(value, list | tuple):
        return [path for one in value for path in _paths(one)]
    return [value] if isinstance(value, Path) else []


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
    name, about = action.__name__, action.__doc__
    command: argparse.ArgumentParser = commands.add_parser(
        name, help=about, description=about, parents=[recording_options()], conflict_handler="resolve"
    )  # `drive` has an option --people of its own
    command.set_defaults(action=action, check=check)
    command.add_argument("scene", type=named_path, nargs=scenes, help=_SCENE)
    return command


def _number(kind: type, least: float, most: float) -> Callable[[str], float]:
    """A number of a kind, from `least` to `most`."""

    def number(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not least <= value <= most:
            what = "a whole number" if kind is int else "a number"
            raise argparse.ArgumentTypeError(f"{text!r}: it must be {what} from {least:g} to {most:g}")
        return value

    return number


_LENGTH_M, _NOISE_M, _SHARE = _number(float, 0.05, 10.0), _number(float, 0.0, 10.0), _number(float, 0.0, 0.99)
_SEED = _number(int, 0, 2**63)


def _add_number(
    command: argparse.ArgumentParser, name: str, number: Callable[[str], float], usual: float, what: str
) -> None:
    """Add an option that is a number; its help says what it is, and its default."""
    command.add_argument(name, type=number, default=usual, help=f"{what} (default {usual:g})")


def _add_output(command: argparse.ArgumentParser, what: str, required: bool = False) -> None:
    command.add_argument("-o", "--output", type=named_path, required=required, help=what)
    command.add_argument("--force", action="store_true", help="replace an existing file")


def _add_network(command: argparse.ArgumentParser) -> None:
    add_model(command)
    lines = "forecasts of the network alone, without learning how far to trust it from people who have left"
    command.add_argument("--no-trust", dest="trust", action="store_false", help=lines)


def _add_prediction(command: argparse.ArgumentParser) -> None:
    where = "an MCAP file, or .csv, .parquet (default: NAME_forecasts.mcap in the current folder)"
    _add_output(command, where)
    _add_network(command)
    command.add_argument("--tracker", type=named_path, help=_TRACKER)
    grid = "also write the predicted occupancy of every step, in cells of this size, m"
    command.add_argument("--grid", type=_number(float, 0.01, 10.0), metavar="M", help=grid)
    noise = "standard deviation of a detection's coordinate, which ellipses are not to include, m"
    _add_number(command, "--detection-noise-m", _NOISE_M, 0.0, noise)


def _add_evaluation(command: argparse.ArgumentParser) -> None:
    _add_network(command)
    add, usual, positive = command.add_argument, EvaluationSettings(), _number(float, 1e-6, 1e6)
    tracker = f"{_TRACKER}; or `{TUNE}`: fit it to the recording itself"
    add("--tracker", type=lambda text: TUNE if text == TUNE else named_path(text), help=tracker)
    windows = "measure as the literature on ETH and UCY does: 8 annotations at 0.4 s are the input, "
    add("--protocol", choices=[PROTOCOL], help=f"{windows}12 are forecast")
    add("--alone", action="store_true", help="forecast each person without the other people")
    theirs = "also measure forecasts of other programs: a table (.csv, .parquet) with track, time, mode, "
    theirs += "weight, step, x, y, or the .ndjson predictions of TrajNet++; may be repeated"
    add("--forecasts", type=named_path, action="append", default=[], metavar="FILE", help=theirs)
    step = "time between two steps of the tables of --forecasts, s (default: that of the model; 0.4 with "
    add("--step-s", type=_number(float, 0.01, 10.0), help=f"{step}--protocol)")
    add("--json", type=named_path, help="write all metrics to this JSON file")
    standing = "people slower than this count as standing, m/s"
    _add_number(command, "--moving-mps", positive, usual.moving_mps, standing)
    near = "forecast paths closer than this collide, m"
    _add_number(command, "--collision-m", positive, usual.collision_m, near)
    _add_number(command, "--samples", _number(int, 1, 100_000), 1000, "bootstrap replicates")
    _add_number(command, "--seed", _SEED, 0, "seed of the bootstrap")


def _add_driving(command: argparse.ArgumentParser) -> None:
    add, robot, sensor = command.add_argument, Robot(), RobotSensor()
    world = "drive in simulated worlds of this kind, a new one for each episode, instead of a scene"
    add("--world", choices=WORLDS, help=world)
    reaction = "whether simulated people react to the robot or ignore it (default react)"
    add("--people", dest="reaction", choices=REACTIONS, help=reaction)
    shown = "give the robot's position to the forecaster, as that of one more person"
    add("--shown", action="store_true", help=shown)
    add("--method", choices=NAMES, action="append", help="forecaster; may be repeated (default: all)")
    limit = "largest probability that the robot overlaps a person, one or several "
    limit += "(default 0.02 0.05 0.1 0.2 0.4)"
    add("--risk", type=_SHARE, action="extend", nargs="+", metavar="P", help=limit)
    _add_number(command, "--seed", _SEED, 0, "seed of episodes and sensor")
    add_model(command)
    other = "also drive with all modes of this model folder, under this name in the table; may be repeated"
    add("--compare", type=_named, action="append", metavar="NAME=FOLDER", help=other)
    add("--robot", choices=KINDS, default=robot.kind, help=f"kind of robot (default {robot.kind})")
    _add_number(command, "--radius-m", _LENGTH_M, robot.radius_m, "radius of the robot, m")
    _add_number(command, "--speed-mps", _LENGTH_M, robot.speed_mps, "largest speed of the robot, m/s")
    _add_number(command, "--range-m", _number(float, 0.1, 1e3), sensor.range_m, "range of the sensor, m")
    _add_number(command, "--view-deg", _number(float, 1, 360), 360.0, "field of view of the sensor, degrees")
    noise = "standard deviation of a detection's coordinate, m"
    _add_number(command, "--noise-m", _NOISE_M, sensor.noise_m, noise)
    _add_number(command, "--missed", _SHARE, sensor.missed, "share of missing detections")
    table = command.add_argument_group("a table of drives", argument_default=argparse.SUPPRESS).add_argument
    file = "file of results; drives in it are not repeated (default: NAME_drives.csv in the current folder)"
    table("--table", type=named_path, metavar="CSV", help=file)
    count = f"number of episodes (default {TABLE_DEFAULTS['episodes']})"
    table("--episodes", type=_number(int, 1, 1e6), help=count)
    table("--processes", type=_number(int, 1, 1000), help="worker processes (default 1)")
    picture = "draw collisions over the time to the goal into this file, a curve for each method"
    table("--curves", type=named_path, metavar="NAME.png", help=picture)
    one = command.add_argument_group("one episode").add_argument
    record = "only write one episode: as MCAP with one method (default: modes), or as a picture of several"
    one("--record", type=named_path, metavar="NAME.mcap|NAME.png", help=record)
    one("--episode", type=_number(int, 0, 1e6), help="number of the episode to record (default 0)")
    one("--force", action="store_true", help="replace an existing recording")


def _named(text: str) -> tuple[str, Path]:
    """A folder, and how it is called."""
    name, sign, folder = text.partition("=")
    if not (name and sign):
        raise argparse.ArgumentTypeError(f"{text!r}: write a name, = and a folder")
    return name, named_path(folder)
