"""Describe and convert recordings of pedestrians, forecast in them and evaluate a network."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pedpred.command.conversion import convert, info
from pedpred.command.prediction import evaluate, predict
from pedpred.errors import PedpredError
from pedpred.evaluation import EvaluationSettings

_SCENE = (
    "a scene folder, an MCAP recording, a ROS bag, a table (.csv, .tsv, .txt) with time, id, x, y, a text "
    "with id, frame, x, y as PeTrack, JuPedSim and PedPy write it, or an .ndjson file of TrajNet++"
)


def parser() -> argparse.ArgumentParser:
    """Make the arguments of all subcommands."""
    top = argparse.ArgumentParser(prog="pedpred", description=__doc__)
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    _reading(_add(commands, info))
    command = _add(commands, convert)
    _output(command, "an MCAP file (.mcap) or a new scene folder")
    _reading(command)
    command = _add(commands, predict)
    _output(command, "an MCAP file (default: NAME_forecasts.mcap in the current folder)", required=False)
    _model(command)
    grid = "also write the predicted occupancy of every step, in cells of this size, m"
    command.add_argument("--grid", type=float, metavar="M", help=grid)
    command = _add(commands, evaluate, scenes="+")
    _model(command)
    _measures(command)
    return top


def _add(commands: Any, action: Callable[[argparse.Namespace], None], scenes: str | None = None) -> Any:
    """Add a subcommand named after its function, which takes one scene or several."""
    command = commands.add_parser(action.__name__, help=action.__doc__, description=action.__doc__)
    command.set_defaults(action=action)
    command.add_argument("scene", type=Path, nargs=scenes, help=_SCENE)
    return command


def _output(command: argparse.ArgumentParser, what: str, required: bool = True) -> None:
    command.add_argument("-o", "--output", type=Path, required=required, help=what)
    command.add_argument("--force", action="store_true", help="replace an existing file")


def _reading(command: argparse.ArgumentParser) -> None:
    command.add_argument("--topic", help="of a bag's people, if several topics carry people")
    pose = "pose of the people's frame in the map's frame, if they differ, m, m, rad"
    command.add_argument("--transform", type=float, nargs=3, metavar=("X", "Y", "YAW"), help=pose)
    named = "columns of a table in order, in place of its header, such as time,id,x,y; others are ignored"
    command.add_argument("--columns", help=named)
    counted = "of frame numbers, in a file that does not say it, Hz"
    command.add_argument("--rate", "--frame-rate", type=float, help=counted)
    replaced = "a folder with map.yaml or a geometry file of JuPedSim (.xml), which replaces the map"
    command.add_argument("--map", type=Path, help=replaced)
    end = "an edge of the geometry's outline beyond which the corridor goes on; may be repeated"
    ends = ("X1", "Y1", "X2", "Y2")
    command.add_argument(
        "--open-end", type=float, nargs=4, metavar=ends, action="append", default=[], help=end
    )


def _model(command: argparse.ArgumentParser) -> None:
    command.add_argument("--model", type=Path, help="a model folder (default: the one of the package)")


def _measures(command: argparse.ArgumentParser) -> None:
    command.add_argument("--json", type=Path, help="write all figures there")
    usual = EvaluationSettings()
    slow = f"slower pedestrians count as standing, m/s (default {usual.moving_mps:g})"
    command.add_argument("--moving-mps", type=float, default=usual.moving_mps, help=slow)
    near = f"forecast paths nearer than this collide, m (default {usual.collision_m:g})"
    command.add_argument("--collision-m", type=float, default=usual.collision_m, help=near)
    command.add_argument("--samples", type=int, default=1000, help="bootstrap replicates (default 1000)")
    command.add_argument("--seed", type=int, default=0, help="of the bootstrap (default 0)")


def main(arguments: list[str] | None = None) -> None:
    """Run a command; errors that a user can fix print their message without a traceback."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    given = parser().parse_args(arguments)
    try:
        given.action(given)
    except PedpredError as error:
        sys.exit(f"{type(error).__name__}: {error}")
