"""`pedpred info` and `pedpred convert`: read a scene in any format, describe it, write it in another."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from pedpred.errors import StorageError, ValueRuleError
from pedpred.ros import is_bag, read_bag, read_recording, write_recording
from pedpred.ros.foxglove import write_layout
from pedpred.scenes import OccupancyMap, Scene
from pedpred.storage.scenes import read_map, read_scene, read_tracks_csv, write_scene

_OPTIONAL = ("velocity", "goal", "desired_speed_mps", "group_id")


def info(given: argparse.Namespace) -> None:
    """Describe the content of a scene."""
    scene = read_any(given.scene)
    trajectories, occupancy = scene.trajectories, scene.occupancy
    tracks, instants = (len(np.unique(values)) for values in (trajectories.track_id, trajectories.time_s))
    span_s = float(np.ptp(trajectories.time_s)) if len(trajectories) else 0.0
    known = [name for name in _OPTIONAL if getattr(trajectories, name) is not None]
    width, height = occupancy.extent_m
    lines = {
        "name": scene.name,
        "detections": f"{len(trajectories)} of {tracks} tracks, {instants} instants",
        "duration": f"{span_s:.1f} s, usually {scene.detection_dt_s:g} s between two detections",
        "map": f"{width:.1f} m x {height:.1f} m, cells of {occupancy.resolution_m:g} m, "
        f"{100 * occupancy.occupied.mean():.1f} % occupied",
        "also known": ", ".join(known) or "nothing",
        "camera": "yes" if scene.camera else "no",
    }
    sys.stdout.writelines(f"{key:>12}  {value}\n" for key, value in lines.items())


def convert(given: argparse.Namespace) -> None:
    """Write a scene as MCAP (a name that ends in .mcap) or as a scene folder."""
    refuse_overwriting(given.output, given.force)
    scene = read_any(given.scene, given.topic)
    if given.scene.suffix == ".csv":  # a table has no name of its own
        scene = replace(scene, name=given.output.stem)
    if given.map is not None:
        scene = replace(scene, occupancy=read_map(given.map))
    if given.output.suffix == ".mcap":
        write_recording(scene, given.output)
        write_layout(scene.occupancy, set(), given.output.with_suffix(".foxglove.json"))
    else:
        write_scene(scene, given.output)


def refuse_overwriting(path: Path, force: bool) -> None:
    """End the command if `path` exists and `--force` is not given."""
    if path.exists() and not force:
        sys.exit(f"{path} is there already; --force replaces it")


def read_any(path: Path, topic: str | None = None) -> Scene:
    """Read a scene folder, a CSV file of tracks (on free ground), a recording or a ROS bag.

    Args:
        path: its name determines the format.
        topic: of a bag's people; an .mcap file is read as a bag if one is given.

    Raises:
        StorageError, SourceError: the file is missing, damaged or of another format.
    """
    if is_bag(path) or (path.suffix == ".mcap" and topic is not None):
        return read_bag(path, topic)
    if path.is_dir():
        return read_scene(path)
    if path.suffix != ".csv":
        return read_recording(path)
    trajectories = read_tracks_csv(path)
    try:
        dt_s = trajectories.usual_interval_s()
    except ValueRuleError as cause:
        raise StorageError(path, "table", str(cause), "A track needs several detections") from cause
    return Scene(path.stem, trajectories, OccupancyMap.free_around(trajectories.position), dt_s)
