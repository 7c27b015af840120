"""Recordings: a scene and forecasts in it as an MCAP file with ROS 2 messages, and back."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
import pandas as pd
from mcap.records import Channel, Message, Metadata
from mcap.well_known import SchemaEncoding
from mcap.writer import Writer
from tqdm import tqdm

from pedpred.errors import InputError, ValueRuleError
from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.files import atomic_write, check_input, translate_errors
from pedpred.ros.bag_files import BagFile
from pedpred.ros.decoding import CDR
from pedpred.ros.frames import Transform, check_frames
from pedpred.ros.markers import Colour, markers_message
from pedpred.ros.mcap_reader import McapReader, records
from pedpred.ros.message_types import FRAMES, MAP, MARKERS, PEOPLE, TYPES, definition, known_types, serialize
from pedpred.ros.people import find_usable
from pedpred.ros.planning import (
    GRID_TYPE,
    PREDICTIONS,
    PREDICTIONS_TYPE,
    grid_messages,
    grid_topic,
    predictions_message,
    tell_rounding,
)
from pedpred.ros.scene_messages import (
    FRAME,
    Content,
    frames_message,
    map_message,
    map_of_grid,
    nanoseconds,
    people_message,
    people_rows,
)
from pedpred.scenes import Predictions, Scene, predicted_occupancy
from pedpred.storage.tracks import tracks_of, tracks_table

_log = logging.getLogger(__name__)
_SCENE_RECORD = "pedpred.scene"
"""Name of the metadata record with the values that no message holds exactly."""
_REMARKS = "unavailable", "stand_in"
"""Fields of a scene that it keeps as they are, where they are not None."""
_CHUNK_BYTES = 256 * 1024
"""Uncompressed size of a chunk: a cut file loses at most this much before the cut."""
_SAME_INSTANT_NS = 1000
"""Times of detections and forecasts that differ by no more are one instant."""
_REMEDY = f"A recording is an MCAP file with {TYPES[MAP]} on {MAP} and {TYPES[PEOPLE]} on {PEOPLE}, in CDR"
_ALWAYS = "{sec: 9223372036, nsec: 854775807}"
_QOS = (
    "- history: 1\n  depth: 10\n  reliability: 1\n  durability: {durability}\n  deadline: {always}\n"
    "  lifespan: {always}\n  liveliness: 1\n  liveliness_lease_duration: {always}\n"
    "  avoid_ros_namespace_conventions: false"
)
_LATCHED, _USUAL = (_QOS.format(durability=number, always=_ALWAYS) for number in (1, 2))
"""How `ros2 bag play` is to publish a topic (rosbag2, metadata up to version 8): reliable, the last ten; the
first one transient local, so that later subscribers get the map, too."""
_NOBODY = "time_s,track_id,x_m,y_m"
"""Columns of a recording without people, which has no message to say them."""


def read_recording(path: Path, transform: Transform | None = None) -> Scene:
    """Read a recording of `write_recording`, or any other with the same topics and types.

    A file that is cut is read up to the cut, with a warning. A recording of another writer is named after the
    file, its resolution is the shortest decimal that rounds to the map's float32, and the time between
    detections is the median. Detections without a place, and second ones of a track in one instant, are left
    out with a warning, and so is what is known of some detections only, such as velocities.

    Args:
        path: the file.
        transform: of the people's frame, where it is not the map's.

    Raises:
        InputError: the file is no MCAP file or damaged, a topic is missing or has another type, or the
            messages make no scene.
    """
    check_input(path)
    problem = partial(InputError, path, None, remedy=_REMEDY)
    rows: list[dict[str, Any]] = []
    bag, last, topics, frames = McapReader([BagFile(path, path)]), b"", set(), set()
    with translate_errors(lambda cause: problem(f"damaged, {cause}")):
        for connection, _, raw in bag.messages():
            topic, kind = connection.topic, connection.msgtype
            if connection.encoding != CDR:
                continue
            topics.add(topic)
            if topic not in (MAP, PEOPLE):
                continue
            if kind != TYPES[topic]:
                raise problem(f"{topic} carries {kind}")
            if topic == MAP:
                last = raw
                continue
            message = known_types().deserialize_cdr(raw, kind)  # whatever definition the file has
            frames |= {message.header.frame_id} if message.people else set()
            with translate_errors(problem):
                rows += people_rows(message)
    for topic in (MAP, PEOPLE):
        if topic not in topics:
            listed = f"nothing on {topic}, only on {sorted(topics)}"
            raise problem(f"{listed}; if it is a bag of ROS, name the topic of its people (--topic)")
    about = bag.metadata.get(_SCENE_RECORD, {})
    with translate_errors(problem):
        grid = known_types().deserialize_cdr(last, TYPES[MAP])
        check_frames(frames, grid.header.frame_id, transform)
        nobody = {name: np.zeros(0) for name in about.get("columns", _NOBODY).split(",")}
        table = pd.DataFrame(rows or nobody)
        time_s, track_id = table["time_s"].to_numpy(), table["track_id"].to_numpy()
        kept, left_out = find_usable(time_s, track_id, table[["x_m", "y_m"]].to_numpy())
        if left_out:
            _log.warning("%s: %s", path, left_out)
        trajectories = tracks_of(_known_of_all(table[kept], path), path)
        trajectories = trajectories if transform is None else transform.moved(trajectories)
        occupancy = map_of_grid(grid, about.get("resolution_m"))
        dt_s = float(about.get("detection_dt_s") or trajectories.usual_interval_s())
        remarks: dict[str, Any] = {remark: about.get(remark) for remark in _REMARKS}
        return Scene(about.get("name", path.stem), trajectories, occupancy, dt_s, **remarks)


def _known_of_all(table: pd.DataFrame, path: Path) -> pd.DataFrame:
    """The columns without those that some rows lack, about which there is a warning."""
    lacking = table.isna().any()
    if lacking.any():
        known = (
            f"{name} of {count} of {len(table)} detections"
            for name, count in table.loc[:, lacking].count().items()
        )
        _log.warning("%s: left out, since others lack it: %s", path, ", ".join(known))
    return table.loc[:, ~lacking]


def is_recording(path: Path) -> bool:
    """Whether a file is a recording of `write_recording`, or none of MCAP; others are bags."""
    with suppress(Exception), catch_warnings():
        simplefilter("ignore")
        for record in records(BagFile(path, path)):
            if isinstance(record, Channel | Message):
                return False
            if isinstance(record, Metadata) and record.name == _SCENE_RECORD:
                return True
    return True


def check_recordable(scene: Scene, steps: int = 1, cell_m: float | None = None) -> None:
    """Check before a long replay that `write_recording` can write a scene and forecasts of some steps in it.

    Raises:
        ValueRuleError: a time cannot be a ROS stamp, or the side of a cell is not a length.
        ShapeError: the cells of all steps are too many.
    """
    nanoseconds(scene.trajectories.time_s)
    if cell_m is not None:
        nobody = Predictions.single(np.zeros((0, steps, 2)), 1.0)
        predicted_occupancy(nobody, scene.occupancy.free(cell_m))


def write_recording(
    scene: Scene,
    path: Path,
    windows: EvaluationWindows | None = None,
    colours: Mapping[str, Colour] | None = None,
    planned: str | None = None,
    cell_m: float | None = None,
) -> None:
    """Write a scene, and forecasts in it, as MCAP with ROS 2 messages (profile `ros2`, CDR).

    The same scene gives the same bytes. `read_recording` returns an equal scene, field by field, but for the
    camera, which is not recorded.

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
    about = {"name": scene.name, "detection_dt_s": repr(float(scene.detection_dt_s))}
    about["resolution_m"] = repr(float(scene.occupancy.resolution_m))
    remarks = {remark: getattr(scene, remark) for remark in _REMARKS}
    about |= {remark: text for remark, text in remarks.items() if text is not None}
    if not len(scene.trajectories):
        about["columns"] = ",".join(map(str, tracks_table(scene.trajectories)))
    with atomic_write(path) as new, new.open("wb") as stream:
        writer = Writer(stream, chunk_size=_CHUNK_BYTES)
        writer.start(profile="ros2")
        writer.add_metadata(_SCENE_RECORD, about)
        types, schemas, channels = _types(windows, planned, cell_m), {}, {}
        for kind in dict.fromkeys(types.values()):
            schemas[kind] = writer.register_schema(kind, SchemaEncoding.ROS2, definition(kind).encode())
        for topic, kind in types.items():
            about_topic = {"offered_qos_profiles": _LATCHED if topic in (MAP, FRAMES) else _USUAL}
            channels[topic] = writer.register_channel(topic, "cdr", schemas[kind], about_topic)
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
        tell_rounding(windows.predictions[planned], _log)
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
