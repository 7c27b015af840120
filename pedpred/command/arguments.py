"""Arguments of `pedpred`, and their checks before any work begins."""

from __future__ import annotations

import argparse
import copy
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pedpred
from pedpred import command as package
from pedpred.command.conversion import convert, info, refuse_overwriting, stem_of, written_to
from pedpred.command.driving import check_drive, drive
from pedpred.command.evaluation import evaluate
from pedpred.command.field_protocol import PROTOCOL
from pedpred.command.foreign import steps_of_tables
from pedpred.command.prediction import predict
from pedpred.command.warming import add_model, add_warm_up, named_path
from pedpred.driving.forecasters import NAMES
from pedpred.driving.robot import KINDS, Robot
from pedpred.driving.sensor import SensorSettings
from pedpred.driving.worlds import KINDS as WORLDS
from pedpred.driving.worlds import REACTIONS
from pedpred.errors import OutputError, ValueRuleError
from pedpred.evaluation import EvaluationSettings
from pedpred.files import check_input, check_output
from pedpred.online.network import read_description
from pedpred.reading import FORMATS
from pedpred.reading.options import UNITS
from pedpred.scenes.people import PERSON_CLASSES

_SCENE = (
    "a scene folder, an MCAP recording, a ROS bag, a table (text, Parquet or Feather) with time, id, x, y, a "
    "text with id, frame, x, y as PeTrack, JuPedSim and PedPy write it, or frame, id, x, y as for SGAN, or "
    f"one of these files: {', '.join(reader.NAME for reader in FORMATS)}"
)
_TRACKER = "a YAML file with acceleration_noise, position_noise_m and initial_speed_mps, as in conf/trackers"


def parser() -> argparse.ArgumentParser:
    """Make the arguments of all subcommands."""
    top = argparse.ArgumentParser(prog="pedpred", description=package.__doc__)
    top.add_argument("--version", action="version", version=f"pedpred {pedpred.__version__}")
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    _add(commands, info, scenes="+").set_defaults(action=_each(info))
    command = _add(commands, convert)
    _output(command, "an MCAP file (.mcap) or a new scene folder")
    command = _add(commands, predict)
    _output(
        command,
        "an MCAP file, or .csv, .parquet (default: NAME_forecasts.mcap in the current folder)",
        required=False,
    )
    _model(command, _TRACKER)
    grid = "also write the predicted occupancy of every step, in cells of this size, m"
    command.add_argument("--grid", type=_number(float, 0.01, 10.0), metavar="M", help=grid)
    noise = "standard deviation of a detection's coordinate, which ellipses are not to include, m"
    _add_number(command.add_argument, "--detection-noise-m", _number(float, 0.0, 10.0), 0.0, noise)
    command = _add(commands, evaluate, scenes="+")
    _model(command, f"{_TRACKER}; or `tune`: fit it to the recording itself")
    _conditions(command)
    _measures(command)
    command = _add(commands, drive, scenes="?")
    _drives(command)
    add_model(add_warm_up(commands))
    return top


def check(arguments: argparse.Namespace) -> None:
    """Check whatever can be checked before work begins: inputs exist, outputs can be written.

    Raises:
        PedpredError: something is wrong with an argument.
    """
    scenes = arguments.scene if isinstance(arguments.scene, list) else [arguments.scene]
    theirs = getattr(arguments, "forecasts", [])
    if getattr(arguments, "no_map", False):
        of_maps = {"--map": "map", "--map-topic": "map_topic", "--open-end": "open_end"}
        for name, field in of_maps.items():
            if value := getattr(arguments, field):
                raise ValueRuleError(name, str(value), "--no-map leaves every map out: omit one")
    steps_of_tables(theirs, getattr(arguments, "step_s", []))
    named = [getattr(arguments, name, None) for name in ("map", "model", "tracker", "homography")]
    inputs = [
        *(path for path in scenes if path),
        *(path for path in named if isinstance(path, Path)),
        *(path for _, path in getattr(arguments, "compare", None) or ()),
        *theirs,
    ]
    for path in inputs:
        check_input(path)
    if arguments.action is predict and arguments.output is None:
        arguments.output = Path(f"{stem_of(arguments.scene)}_forecasts.mcap")
    if output := getattr(arguments, "output", None):
        for path in written_to(output):
            _check_output(path, inputs, folder=arguments.action is convert and output.suffix != ".mcap")
        refuse_overwriting(output, arguments.force)
    if arguments.action is drive:
        check_drive(arguments)
        recorded = () if arguments.record is None else written_to(arguments.record)
        for path in filter(None, (arguments.table, arguments.curves, *recorded)):
            _check_output(path, inputs)
        if arguments.record is not None:
            refuse_overwriting(arguments.record, arguments.force)
    if figures := getattr(arguments, "json", None):
        _check_output(figures, inputs)
    if model := getattr(arguments, "model", None):
        read_description(model)
    if theirs and len(scenes) > 1:
        raise ValueRuleError("--forecasts", str(theirs[0]), "give the one scene that they are about")
    for field, paths in {"scene": scenes, "--forecasts": theirs}.items():
        for number, path in enumerate(paths):
            if arguments.action is evaluate and any(path.samefile(other) for other in paths[:number]):
                raise ValueRuleError(field, str(path), "it is given twice")


def _check_output(path: Path, inputs: list[Path], folder: bool = False) -> None:
    check_output(path, folder)
    if any(path.exists() and path.samefile(other) for other in inputs):
        raise OutputError(path, "it is an input of this command")


def _each(action: Callable[[argparse.Namespace], None]) -> Callable[[argparse.Namespace], None]:
    """Apply an action to each of several scenes."""

    def for_all(arguments: argparse.Namespace) -> None:
        for number, scene in enumerate(arguments.scene):
            one = copy.copy(arguments)
            one.scene = scene
            sys.stdout.write("\n" if number else "")
            action(one)

    return for_all


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


def _add_number(
    add: Callable[..., object], name: str, number: Callable[[str], float], usual: float, what: str
) -> None:
    """Add an option that is a number; its help says what it is, and its usual value."""
    add(name, type=number, default=usual, help=f"{what} (default {usual:g})")


def _named(text: str) -> tuple[str, Path]:
    """A folder, and how it is called."""
    name, sign, folder = text.partition("=")
    if not (name and sign):
        raise argparse.ArgumentTypeError(f"{text!r}: write a name, = and a folder")
    return name, named_path(folder)


def _about(command: Any, what: str) -> Callable[..., None]:
    """Adds options that are about something: `about_WHAT` holds the field and the usual value of each."""
    about: dict[str, tuple[str, Any]] = {}
    command.set_defaults(**{f"about_{what}": about})

    def option(name: str, *others: str, **how: Any) -> None:
        added = command.add_argument(name, *others, **how)
        about[name] = added.dest, added.default

    return option


def _add(commands: Any, action: Callable[[argparse.Namespace], None], scenes: str | None = None) -> Any:
    """Add a subcommand named after its function, which reads one scene or several."""
    command = commands.add_parser(action.__name__, help=action.__doc__, description=action.__doc__)
    command.set_defaults(action=action)
    command.add_argument("scene", type=named_path, nargs=scenes, help=_SCENE)
    option = _about(command, "recordings")
    option("--topic", help="topic of the people in a bag, if several topics carry people")
    grids = "topic of the map in a bag (default: /map, or else the only grid that is no costmap); '': no map"
    option("--map-topic", help=grids)
    kinds = (
        f"class of people (default: any with the word {', '.join(PERSON_CLASSES)}); may be repeated; '': all"
    )
    option("--class", dest="classes", action="append", metavar="CLASS", help=kinds)
    pose = "pose of the people's frame in the map's frame, if the two differ, m, m, rad"
    option("--transform", type=float, nargs=3, metavar=("X", "Y", "YAW"), help=pose)
    named = "the columns of a table: time=t_ros,id=agent,x=px,y=py by title, or frame,id,x,y in their order"
    option("--columns", help=named)
    option(
        "--delimiter", metavar="SIGN", help="between the columns of a text (default: found in its first line)"
    )
    option("--decimal", choices=[".", ","], default=".", help="decimal mark of a text (default .)")
    option("--encoding", help="of a text, such as cp1252 (default: UTF-8, or UTF-16 with a mark)")
    files = "SCENE is a folder with a file for each person, whose name is the id"
    option("--one-person-per-file", action="store_true", help=files)
    fast = "read people who are faster than people walk, with a warning"
    option("--any-speed", action="store_true", help=fast)
    counted = "frames per second, if the file counts frames and does not state their rate, Hz"
    option("--rate", "--frame-rate", type=float, help=counted)
    long = "unit of lengths in a table or text (default: what the file says, else m)"
    option("--unit", choices=list(UNITS), help=long)
    side = "side of a pixel, if positions are pixels of a picture (Stanford Drone Dataset, tables), m"
    option("--scale", type=_number(float, 1e-6, 10.0), metavar="METRES_PER_PIXEL", help=side)
    flat = "instead of --scale: a text file with 3 x 3 numbers that map (x, y, 1) in pixels to metres"
    option("--homography", type=named_path, metavar="FILE", help=flat)
    replaced = (
        "map.yaml, its picture or its folder, or a geometry of JuPedSim (.xml, .wkt); replaces the map "
    )
    replaced += "(default: that of the recording, or the map.yaml in the folder of a table)"
    option("--map", type=named_path, help=replaced)
    option("--no-map", action="store_true", help="ignore all maps: no obstacles")
    end = "an edge of the geometry's outline beyond which the ground continues; may be repeated"
    ends = ("X1", "Y1", "X2", "Y2")
    option("--open-end", type=float, nargs=4, metavar=ends, action="append", default=[], help=end)
    return command


def _output(command: argparse.ArgumentParser, what: str, required: bool = True) -> None:
    command.add_argument("-o", "--output", type=named_path, required=required, help=what)
    command.add_argument("--force", action="store_true", help="replace an existing file")


def _model(command: argparse.ArgumentParser, tracker: str) -> None:
    add_model(command)
    command.add_argument(
        "--tracker", type=lambda text: text if text == "tune" else named_path(text), help=tracker
    )
    lines = "forecasts of the network alone, without learning how far to trust it from people who have left"
    command.add_argument("--no-trust", dest="trust", action="store_false", help=lines)


def _conditions(command: argparse.ArgumentParser) -> None:
    usual = (
        "measure as the literature on ETH and UCY does: 8 annotations at 0.4 s are the input, 12 are forecast"
    )
    command.add_argument("--protocol", choices=[PROTOCOL], help=usual)
    command.add_argument("--alone", action="store_true", help="forecast each person without the other people")
    theirs = (
        "also measure forecasts of other programs: a table (.csv, .parquet) with track, time, mode, weight, "
    )
    theirs += "step, x, y, or the .ndjson predictions of TrajNet++; may be repeated"
    command.add_argument(
        "--forecasts", type=named_path, action="append", default=[], metavar="FILE", help=theirs
    )
    step = (
        "time between two steps of the tables of --forecasts, s: one for all, or one for each (default: that "
    )
    step += "of the model; 0.4 with --protocol)"
    command.add_argument("--step-s", type=_number(float, 0.01, 10.0), action="append", default=[], help=step)


def _measures(command: argparse.ArgumentParser) -> None:
    command.add_argument("--json", type=named_path, help="write all metrics to this JSON file")
    add, usual, positive = command.add_argument, EvaluationSettings(), _number(float, 1e-6, 1e6)
    _add_number(
        add, "--moving-mps", positive, usual.moving_mps, "people slower than this count as standing, m/s"
    )
    near = "forecast paths closer than this collide, m"
    _add_number(add, "--collision-m", positive, usual.collision_m, near)
    _add_number(add, "--samples", _number(int, 1, 100_000), 1000, "bootstrap replicates")
    _add_number(add, "--seed", _number(int, 0, 2**63), 0, "seed of the bootstrap")


def _drives(command: argparse.ArgumentParser) -> None:
    world = "drive in simulated worlds of this kind, a new one for each episode, instead of a scene"
    command.add_argument("--world", choices=WORLDS, help=world)
    reaction = "whether simulated people react to the robot or ignore it (default react)"
    command.add_argument("--people", choices=REACTIONS, help=reaction)
    shown = "give the robot's position to the forecaster, as that of one more person"
    command.add_argument("--shown", action="store_true", help=shown)
    table = "file of results; drives in it are not repeated (default: NAME_drives.csv in the current folder)"
    of_tables = _about(command, "tables")
    of_tables("--table", type=named_path, metavar="CSV", help=table)
    _add_number(of_tables, "--episodes", _number(int, 1, 1e6), 100, "number of episodes")
    command.add_argument(
        "--method", choices=NAMES, action="append", help="forecaster; may be repeated (default: all)"
    )
    limit = (
        "largest probability that the robot overlaps a person, one or several (default 0.02 0.05 0.1 0.2 0.4)"
    )
    rate = _number(float, 0.0, 0.99)
    command.add_argument("--risk", type=rate, action="extend", nargs="+", metavar="P", help=limit)
    _add_number(command.add_argument, "--seed", _number(int, 0, 2**63), 0, "seed of episodes and sensor")
    add_model(command)
    other = "also drive with all modes of this model folder, under this name in the table; may be repeated"
    command.add_argument("--compare", type=_named, action="append", metavar="NAME=FOLDER", help=other)
    robot, sensor, add = Robot(), SensorSettings(), command.add_argument
    add("--robot", choices=KINDS, default=robot.kind, help=f"kind of robot (default {robot.kind})")
    length, noise = _number(float, 0.05, 10.0), "standard deviation of a detection's coordinate, m"
    _add_number(add, "--radius-m", length, robot.radius_m, "radius of the robot, m")
    _add_number(add, "--speed-mps", length, robot.speed_mps, "largest speed of the robot, m/s")
    _add_number(add, "--range-m", _number(float, 0.1, 1000.0), sensor.range_m, "range of the sensor, m")
    _add_number(add, "--view-deg", _number(float, 1.0, 360.0), 360.0, "field of view of the sensor, degrees")
    _add_number(add, "--noise-m", _number(float, 0.0, 10.0), sensor.noise_m, noise)
    _add_number(add, "--missed", _number(float, 0.0, 0.99), sensor.missed, "share of missing detections")
    _add_number(of_tables, "--processes", _number(int, 1, 1000), 1, "worker processes")
    picture = "draw collisions over the time to the goal into this file, a curve for each method"
    of_tables("--curves", type=named_path, metavar="NAME.png", help=picture)
    record = (
        "only write one episode: as MCAP with one method (default: modes), or as a picture of several methods"
    )
    command.add_argument("--record", type=named_path, metavar="NAME.mcap|NAME.png", help=record)
    which = "number of the episode to record (default 0)"
    command.add_argument("--episode", type=_number(int, 0, 1e6), help=which)
    command.add_argument("--force", action="store_true", help="replace an existing recording")
