"""Options that say what a recording does not say itself: the same for all commands that read one."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from pedpred.command.recordings import OPEN_FIELDS, Edge, OpenOptions
from pedpred.reading.options import UNITS, ReadOptions
from pedpred.reading.pixels import read_homography
from pedpred.ros import Transform
from pedpred.ros.identities import MODES
from pedpred.scenes.people import PERSON_CLASSES

_OPTION_OF = {
    "classes": "--class",
    "rate_hz": "--rate",
    "pixel_m": "--scale",
    "open_ends": "--open-end",
    "reaction": "--people",  # of `pedpred drive`
}
"""Field -> option, where the names differ."""


def option_of(field: str) -> str:
    """The option that sets a field."""
    return _OPTION_OF.get(field, f"--{field.replace('_', '-')}")


def named_path(text: str) -> Path:
    """Take the path that an argument names.

    Raises:
        ArgumentTypeError: it is empty.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError("the name is empty")
    return Path(text)


def recording_options() -> argparse.ArgumentParser:
    """Make a parent of the parsers of commands; options that are not given are not in the namespace."""
    parent = argparse.ArgumentParser(add_help=False, argument_default=argparse.SUPPRESS)
    add = parent.add_argument
    add("--topic", help="topic of the people in a bag, if several topics carry people")
    grids = "topic of the map in a bag (default: /map, or else the only grid that is no costmap); '': no map"
    add("--map-topic", help=grids)
    fields = "fields of the people in messages of another type, such as people,id=id,position=pose.position,"
    add("--people", metavar="FIELDS", help=f"{fields}class=label")
    ids = "ids of people in a bag: auto (default): those of the messages if they stay, else by position"
    add("--identities", choices=MODES, help=ids)
    pose = "pose of the people's frame in the map's frame, if the two differ, m, m, rad"
    add("--transform", type=float, nargs=3, metavar=("X", "Y", "YAW"), help=pose)
    usual = f"any with the word {', '.join(PERSON_CLASSES)}"
    kinds = f"class of people (default: {usual}); may be repeated; '': all"
    add("--class", dest="classes", action="append", metavar="CLASS", help=kinds)
    named = "columns of a table: time=t_ros,id=agent,x=px,y=py by title, or frame,id,x,y in their order"
    add("--columns", help=named)
    sign = "between the columns of a text (default: found in its first line)"
    add("--delimiter", metavar="SIGN", help=sign)
    add("--decimal", choices=[".", ","], help="decimal mark of a text (default .)")
    add("--encoding", help="of a text, such as cp1252 (default: UTF-8, or UTF-16 with a mark)")
    files = "SCENE is a folder with a file for each person, whose name is the id"
    add("--one-person-per-file", action="store_true", help=files)
    fast = "read people who are faster than people walk, with a warning"
    add("--any-speed", action="store_true", help=fast)
    counted = "frames per second, if the file counts frames and does not state their rate, Hz"
    add("--rate", "--frame-rate", dest="rate_hz", type=float, metavar="RATE", help=counted)
    long = "unit of lengths in a table or text (default: what the file says, else m)"
    add("--unit", choices=list(UNITS), help=long)
    side = "side of a pixel, if positions are pixels of a picture (Stanford Drone Dataset, tables), m"
    add("--scale", dest="pixel_m", type=float, metavar="METRES_PER_PIXEL", help=side)
    flat = "instead of --scale: a text file with 3 x 3 numbers that map (x, y, 1) in pixels to metres"
    add("--homography", type=named_path, metavar="FILE", help=flat)
    kinds = "map.yaml, its picture or its folder, or a geometry of JuPedSim (.xml, .wkt)"
    usual = "that of the recording, or the map.yaml in the folder of a table"
    add("--map", type=named_path, help=f"{kinds}; replaces the map (default: {usual})")
    add("--no-map", action="store_true", help="ignore all maps: no obstacles")
    end = "an edge of the geometry's outline beyond which the ground continues; may be repeated"
    ends = ("X1", "Y1", "X2", "Y2")
    add("--open-end", dest="open_ends", type=float, nargs=4, metavar=ends, action="append", help=end)
    return parent


def given_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """The options of recordings that were given: field of `OpenOptions` or `ReadOptions` -> value."""
    return {name: getattr(arguments, name) for name in OPEN_FIELDS if name in arguments}


def open_options(arguments: argparse.Namespace) -> OpenOptions:
    """Make the options of a recording from the arguments of a command.

    Raises:
        ValueRuleError: a value is wrong, or two contradict each other.
        InputError: the file of a homography cannot be read.
    """
    given = given_options(arguments)
    given |= {name: convert(given[name]) for name, convert in _CONVERT.items() if name in given}
    of_files = {one.name for one in fields(ReadOptions)} & given.keys()
    file = ReadOptions(**{name: given.pop(name) for name in of_files})
    return OpenOptions(file, **given)


def _columns(text: str) -> Mapping[str, str] | tuple[str, ...]:
    """The columns in `time=t_ros,id=agent` (by title) or `frame,id,x,y` (by position)."""
    parts = [part.strip() for part in text.split(",")]
    if not any("=" in part for part in parts):
        return tuple(parts)
    pairs = [part.partition("=") for part in parts]
    return {quantity.strip(): title.strip() for quantity, _, title in pairs}


def _edges(ends: list[list[float]]) -> tuple[Edge, ...]:
    return tuple(((x1, y1), (x2, y2)) for x1, y1, x2, y2 in ends)


_CONVERT: dict[str, Callable[[Any], Any]] = {
    "columns": _columns,
    "classes": tuple,
    "transform": lambda pose: Transform(*pose),
    "homography": read_homography,
    "open_ends": _edges,
}
