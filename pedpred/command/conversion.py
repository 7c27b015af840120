"""`pedpred info` and `pedpred convert`: describe a recording, or write it in another format."""

from __future__ import annotations

import argparse
import logging
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from pedpred.command.recordings import open_recording
from pedpred.errors import ValueRuleError
from pedpred.reading import Recording
from pedpred.ros import write_recording
from pedpred.ros.foxglove import write_layout
from pedpred.scenes import Scene, placement
from pedpred.storage.scenes import write_scene

MCAP = ".mcap"
_OPTIONAL = ("velocity", "goal", "desired_speed_mps", "group_id", "person_id")
_log = logging.getLogger(__name__)


def info(arguments: argparse.Namespace) -> None:
    """Describe the content of recordings."""
    for number, path in enumerate(arguments.scene):
        about = _about(open_recording(path, arguments.options))
        sys.stdout.write("\n" if number else "")
        sys.stdout.writelines(f"{key:>12}  {value}\n" for key, value in about.items())


def _about(recording: Recording) -> dict[str, str]:
    scene, people, ground = recording.scene, recording.scene.trajectories, recording.scene.occupancy
    tracks, instants = (len(np.unique(values)) for values in (people.track_id, people.time_s))
    span_s = float(np.ptp(people.time_s)) if len(people) else 0.0
    known = [name for name in _OPTIONAL if getattr(people, name) is not None]
    occupied = "no obstacles are known"
    if ground.occupied.any():
        width, height = ground.extent_m
        share = f"{100 * ground.occupied.mean():.1f} % occupied"
        occupied = f"{width:.1f} m x {height:.1f} m, cells of {ground.resolution_m:g} m, {share}"
    return {
        "name": scene.name,
        "read as": recording.format,
        "detections": f"{len(people)} of {tracks} tracks, {instants} instants",
        "duration": f"{span_s:.1f} s, usually {scene.detection_dt_s:.3g} s between two detections",
        "map": occupied,
        "on the map": str(placement(people.position, ground)),
        "also known": ", ".join(known) or "nothing",
        "camera": "yes" if scene.camera else "no",
    }


def check_conversion(arguments: argparse.Namespace) -> None:
    """Check the name of the output.

    Raises:
        ValueRuleError: it is neither that of an MCAP file nor that of a folder.
    """
    if arguments.output.suffix not in ("", MCAP):
        rule = "a name ends in .mcap, or has no dot, as that of a scene folder"
        raise ValueRuleError("output", str(arguments.output), rule)


def convert(arguments: argparse.Namespace) -> None:
    """Write a recording as MCAP (a name that ends in .mcap) or as a scene folder."""
    scene, output = open_recording(arguments.scene, arguments.options).scene, arguments.output
    if arguments.scene.is_file():
        scene = replace(scene, name=output.stem)
    _log.info("%s: %s", scene.name, placement(scene.trajectories.position, scene.occupancy))
    if output.suffix == MCAP:
        write_recording(scene, output)
        write_layout_beside(output, scene)
    else:
        write_scene(scene, output)


def output_paths(path: Path) -> list[Path]:
    """All paths that are written for an output: beside a recording, its layout for Foxglove."""
    return [path, _layout_of(path)] if path.suffix == MCAP else [path]


def write_layout_beside(recording: Path, scene: Scene) -> None:
    """Write the layout for Foxglove of a recording."""
    write_layout(scene.occupancy, set(), _layout_of(recording))


def _layout_of(recording: Path) -> Path:
    return recording.with_suffix(".foxglove.json")


def stem_of(path: Path) -> str:
    """The name of an output after an input; `.` and `..` have the names of their folders."""
    return Path(os.path.abspath(path)).stem  # without following links
