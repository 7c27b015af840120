"""Options for what a recording does not contain: the same for all commands that read one."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

from pedpred.command.recordings import OPEN_FIELDS, OpenOptions
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
    "bootstrap": "--samples",
}
"""Field -> option, where the names differ."""


def option_of(field: str) -> str:
    """The option that sets a field."""
    return _OPTION_OF.get(field, f"--{field.replace('_', '-')}")


def recording_options() -> argparse.ArgumentParser:
    """Make a parent of the parsers of commands; options that are not given are not in the namespace."""
    parent = argparse.ArgumentParser(add_help=False, argument_default=argparse.SUPPRESS)
    add = parent.add_argument_group("recordings in ROS bags").add_argument
    add("--topic", help="topic of the people, if several topics carry people")
    add(
        "--map-topic",
        help="topic of the map, '': none (default: /map, or else the only grid that is no costmap)",
    )
    message = "fields of messages of other types, such as people,id=id,position=pose.position,class=label"
    add("--people", metavar="FIELDS", help=message)
    ids = "ids of people: auto (default): those of the messages if they stay, else by position"
    add("--identities", choices=MODES, help=ids)
    add = parent.add_argument_group("recordings in tables and other files").add_argument
    columns = "columns of a table: time=t_ros,id=agent,x=px,y=py by title, or frame,id,x,y in their order"
    add("--columns", type=_columns, help=columns)
    add("--delimiter", metavar="SIGN", help="between the columns (default: found in the first line)")
    add("--decimal", choices=[".", ","], help="decimal mark (default .)")
    add("--encoding", help="of a text, such as cp1252 (default: UTF-8, or UTF-16 with a mark)")
    one_each = "SCENE is a folder with a file for each person, whose name is the id"
    add("--one-person-per-file", action="store_true", help=one_each)
    rate = "frames per second, if the file counts frames and does not state their rate, Hz"
    add("--rate", "--frame-rate", dest="rate_hz", type=float, metavar="RATE", help=rate)
    add("--unit", choices=list(UNITS), help="unit of lengths (default: what the file says, else m)")
    side = "side of a pixel, if positions are pixels of a picture, m"
    add("--scale", dest="pixel_m", type=float, metavar="METRES_PER_PIXEL", help=side)
    matrix = "instead of --scale: a text file with 3 x 3 numbers that map (x, y, 1) in pixels to metres"
    add("--homography", type=Path, metavar="FILE", help=matrix)
    add = parent.add_argument_group("all recordings").add_argument
    classes = f"class of people, may be repeated; '': all (default: with {', '.join(PERSON_CLASSES)})"
    add("--class", dest="classes", action="append", metavar="CLASS", help=classes)
    add("--any-speed", action="store_true", help="read people who are faster than people walk")
    pose = "pose of the people's frame in the map's frame, if the two differ, m, m, rad"
    add("--transform", type=float, nargs=3, metavar=("X", "Y", "YAW"), help=pose)
    maps = "map.yaml, its picture or its folder, or a geometry (.xml, .wkt), in place of the recording's map"
    add("--map", type=Path, help=f"{maps} or of the map.yaml in the folder of a table")
    add("--no-map", action="store_true", help="ignore all maps: no obstacles")
    end = "an edge of the geometry's outline beyond which the ground continues; may be repeated"
    ends = ("X1", "Y1", "X2", "Y2")
    add("--open-end", dest="open_ends", type=float, nargs=4, metavar=ends, action="append", help=end)
    return parent


def _columns(text: str) -> Mapping[str, str] | tuple[str, ...]:
    """The columns in `time=t_ros,id=agent` (by title) or `frame,id,x,y` (by position)."""
    parts = [part.strip() for part in text.split(",")]
    if not any("=" in part for part in parts):
        return tuple(parts)
    pairs = [part.partition("=") for part in parts]
    return {quantity.strip(): title.strip() for quantity, _, title in pairs}


def open_options(arguments: argparse.Namespace) -> OpenOptions:
    """Make the options of a recording from the arguments of a command.

    Raises:
        ValueRuleError: a value is wrong, or two contradict each other.
        InputError: the file of a homography cannot be read.
    """
    given = {name: getattr(arguments, name) for name in OPEN_FIELDS if name in arguments}
    if "transform" in given:
        given["transform"] = Transform(*given["transform"])
    if "homography" in given:
        given["homography"] = read_homography(given["homography"])
    if "open_ends" in given:
        given["open_ends"] = tuple(((x1, y1), (x2, y2)) for x1, y1, x2, y2 in given["open_ends"])
    if "classes" in given:
        given["classes"] = tuple(given["classes"])
    of_files = {one.name for one in fields(ReadOptions)} & given.keys()
    return OpenOptions(ReadOptions(**{name: given.pop(name) for name in of_files}), **given)
