"""Recordings: a scene and forecasts in it as an MCAP file with ROS 2 messages."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from mcap.well_known import SchemaEncoding
from mcap.writer import Writer
from tqdm import tqdm

from pedpred.errors import ValueRuleError
from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.files import atomic_write
from pedpred.ros.grids import GRID_TYPE, grid_messages, grid_topic
from pedpred.ros.markers import Colour, markers_message
from pedpred.ros.message_types import FRAMES, MAP, MARKERS, PEOPLE, TYPES, definition, serialize
from pedpred.ros.planning import PREDICTIONS, PREDICTIONS_TYPE, predictions_message, warn_of_rounding
from pedpred.ros.scene_messages import (
    FRAME,
    Content,
    frames_message,
    map_message,
    nanoseconds,
    people_message,
)
from pedpred.scenes import Predictions, Scene, predicted_occupancy
from pedpred.storage.tracks import tracks_table

_log = logging.getLogger(__name__)
_CHUNK_BYTES = 256 * 1024
"""Uncompressed size of a chunk: a cut file loses at most this much before the cut."""
_SAME_INSTANT_NS = 1000
"""Times of detections and forecasts that differ by no more are one instant."""
_ALWAYS = "{sec: 9223372036, nsec: 854775807}"
_QOS = (
    "- history: 1\n  depth: 10\n  reliability: 1\n  durability: {durability}\n  deadline: {always}\n"
    "  lifespan: {always}\n  liveliness: 1\n  liveliness_lease_duration: {always}\n"
    "  avoid_ros_namespace_conventions: false"
)
_LATCHED, _USUAL = (_QOS.format(durability=number, always=_ALWAYS) for number in (1, 2))
"""How `ros2 bag play` is to publish a topic (rosbag2, metadata up to version 8): reliable, the last ten; the
first one transient local, so that later subscribers get the map, too."""


def check_recordable(scene: Scene, steps: int = 1, cell_m: float | None = None) -> None:
    """Check before a long replay that `write_recording` can write a scene and forecasts of some steps in it.

    Raises:
        ValueRuleError: a time cannot be a ROS stamp, the side of a cell is not a length, or the cells of all
            steps are too many.
    """
    nanoseconds(scene.trajectories.time_s)
    if cell_m is not None:
        none = Predictions.single(np.zeros((0, steps, 2)), 1.0)
        predicted_occupancy(none, scene.occupancy.free(cell_m))


def write_recording(
    scene: Scene,
    path: Path,
    windows: EvaluationWindows | None = None,
    colours: Mapping[str, Colour] | None = None,
    planned: str | None = None,
    cell_m: float | None = None,
) -> None:
    """Write a scene, and forecasts in it, as MCAP with ROS 2 messages (profile `ros2`, CDR).

    The same scene gives the same bytes. `read_bag` reads people and the map; goals, groups and the camera are
    not recorded, and scene folders (`pedpred.storage`) keep them.

    Args:
        scene: people (`/people`, `/markers`) and obstacles (`/map`).
        path: the file.
        windows: forecasts of this scene, drawn in `/markers`.
        colours: which methods of `windows` to draw, and how; none by default.
        planned: the method whose forecasts planners find in `/predictions`, see `pedpred.ros.planning`.
        cell_m: side of the cells of its predicted occupancy, which is left out by default, m.

    Raises:
        ValueRuleError: a time cannot be a ROS stamp, or a method has no forecasts.
    """
    asked = {*(colours or ()), *({planned} if planned else ())}
    unknown = sorted(asked - set(windows.predictions if windows else ()))
    if unknown:
        raise ValueRuleError("method", unknown[0], f"scene {scene.name} has no forecasts of it")
    with atomic_write(path) as new, new.open("wb") as stream:
        writer = Writer(stream, chunk_size=_CHUNK_BYTES)
        writer.start(profile="ros2")
        types, schemas, channels = _types(windows, planned, cell_m), {}, {}
        for kind in dict.fromkeys(types.values()):
            schemas[kind] = writer.register_schema(kind, SchemaEncoding.ROS2, definition(kind).encode())
        for topic, kind in types.items():
            profile = {"offered_qos_profiles": _LATCHED if topic in (MAP, FRAMES) else _USUAL}
            channels[topic] = writer.register_channel(topic, "cdr", schemas[kind], profile)
        messages = _messages(scene, windows, colours or {}, planned, cell_m)
        for count, (time_ns, topic, content) in enumerate(messages):
            data = serialize(types[topic], content)
            writer.add_message(channels[topic], time_ns, data, publish_time=time_ns, sequence=count)
        writer.finish()


def _types(windows: EvaluationWindows | None, planned: str | None, cell_m: float | None) -> dict[str, str]:
    """Topic -> type of all messages in a recording."""
    if windows is None or planned is None:
        return TYPES
    steps = windows.predictions[planned].steps if cell_m is not None else 0
    grids = {grid_topic(step + 1): GRID_TYPE for step in range(steps)}
    return TYPES | {PREDICTIONS: PREDICTIONS_TYPE} | grids


def _messages(
    scene: Scene,
    windows: EvaluationWindows | None,
    colours: Mapping[str, Colour],
    planned: str | None,
    cell_m: float | None,
) -> Iterator[tuple[int, str, Content]]:
    """(time in ns, topic, message) in order of time, the map and the frames first.

    Forecasts are drawn at the latest detection up to their present.
    """
    table = tracks_table(scene.trajectories)
    people = {str(name): table[name].to_numpy() for name in table}
    detected = nanoseconds(scene.trajectories.time_s)
    instants = np.unique(detected) if len(detected) else np.zeros(1, np.int64)
    present = nanoseconds(windows.time_s if windows else np.zeros(0))
    latest = np.searchsorted(instants, present + _SAME_INSTANT_NS, side="right") - 1
    order = np.argsort(latest, kind="stable")
    drawn = np.searchsorted(latest[order], np.arange(len(instants) + 1))
    ends = np.searchsorted(detected, instants, side="right")
    start_ns = int(instants[0])
    ground = None if cell_m is None else scene.occupancy.free(cell_m)
    if windows is not None and planned is not None:
        warn_of_rounding(windows.predictions[planned], _log)
    yield start_ns, FRAMES, frames_message(start_ns)
    yield start_ns, MAP, map_message(scene.occupancy, start_ns)
    first = 0
    for index, time_ns in enumerate(tqdm(instants.tolist(), desc="record", unit="instant", disable=None)):
        here = {name: values[first : ends[index]].tolist() for name, values in people.items()}
        first, rows = ends[index], order[drawn[index] : drawn[index + 1]]
        yield time_ns, PEOPLE, people_message(here, time_ns)
        yield time_ns, MARKERS, markers_message(here, windows, rows, colours, time_ns)
        if windows is not None and planned is not None:
            forecasts = windows.predictions[planned].select(rows)
            yield time_ns, PREDICTIONS, predictions_message(windows.track_id[rows], forecasts, time_ns, FRAME)
            if ground is not None:
                for topic, content in grid_messages(forecasts, ground, time_ns, FRAME).items():
                    yield time_ns, topic, content
