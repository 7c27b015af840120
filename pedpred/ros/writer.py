"""Writing recordings: the same scene gives the same bytes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from mcap_ros2.writer import Writer

from pedpred.errors import ValueRuleError
from pedpred.files import atomic_write
from pedpred.ros.interfaces import FRAMES, MAP, MARKERS, PEOPLE, TYPES, definition
from pedpred.ros.messages import (
    Colour,
    Message,
    frames_message,
    map_message,
    markers_message,
    nanoseconds,
    people_message,
)
from pedpred.scenes import Scene
from pedpred.storage.scenes import tracks_table
from pedpred.storage.windows import Windows

SCENE_RECORD = "pedpred.scene"
"""Name of the metadata record with what no message has an exact place for."""

_CHUNK_BYTES = 256 * 1024
"""A recording that is cut loses at most as much of what came before the cut (uncompressed)."""
_SAME_INSTANT_NS = 1000
"""Times of detections and forecasts that differ by no more are one instant."""


def write_recording(
    scene: Scene,
    path: Path,
    windows: Windows | None = None,
    colours: Mapping[str, Colour] | None = None,
) -> None:
    """Write a scene, and forecasts in it, as MCAP with ROS 2 messages (profile `ros2`, CDR).

    `read_recording` returns an equal scene, but for the camera, which is not recorded.

    Args:
        scene: people (`/people`, `/markers`) and obstacles (`/map`).
        path: the file.
        windows: forecasts of this scene, drawn in `/markers`.
        colours: which methods of `windows` to draw, and how; none by default.

    Raises:
        ValueRuleError: a time cannot be a ROS stamp, or a method has no forecasts.
    """
    strangers = sorted(set(colours or ()) - set(windows.paths if windows else ()))
    if strangers:
        raise ValueRuleError("colours", strangers[0], f"scene {scene.name} has no forecasts of it")
    with (
        atomic_write(path) as new,
        new.open("wb") as stream,
        Writer(stream, chunk_size=_CHUNK_BYTES) as writer,
    ):
        about = {"name": scene.name, "detection_dt_s": repr(float(scene.detection_dt_s))}
        about["resolution_m"] = repr(float(scene.occupancy.resolution_m))
        writer.add_metadata(SCENE_RECORD, about)
        schemas = {name: writer.register_msgdef(kind, definition(kind)) for name, kind in TYPES.items()}
        for count, (time_ns, topic, message) in enumerate(_messages(scene, windows, colours or {})):
            writer.write_message(topic, schemas[topic], message, log_time=time_ns, sequence=count)


def _messages(
    scene: Scene, windows: Windows | None, colours: Mapping[str, Colour]
) -> Iterator[tuple[int, str, Message]]:
    """(time in ns, topic, message) in the order of time; map and frames once, before everything else.

    Forecasts are part of the picture at the latest detection up to their present.
    """
    people = tracks_table(scene.trajectories)
    clock = nanoseconds(scene.trajectories.time_s)
    instants = np.unique(clock) if len(clock) else np.zeros(1, np.int64)
    present = nanoseconds(windows.time_s if windows else np.zeros(0))
    latest = np.searchsorted(instants, present + _SAME_INSTANT_NS, side="right") - 1
    start_ns = int(instants[0])
    yield start_ns, FRAMES, frames_message(start_ns)
    yield start_ns, MAP, map_message(scene.occupancy, start_ns)
    for index, time_ns in enumerate(instants.tolist()):
        here = people.iloc[slice(*np.searchsorted(clock, [time_ns, time_ns + 1]))]
        rows = np.flatnonzero(latest == index)
        yield time_ns, PEOPLE, people_message(here, time_ns)
        yield time_ns, MARKERS, markers_message(here, windows, rows, colours, time_ns)
