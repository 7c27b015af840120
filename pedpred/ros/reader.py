"""Reading recordings back, also those that end in the middle."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from mcap.records import Channel, Message, Metadata, Schema
from mcap_ros2.decoder import DecoderFactory

from pedpred.errors import SourceError, ValueRuleError
from pedpred.files import translate_errors
from pedpred.ros.interfaces import MAP, PEOPLE, TYPES, definition
from pedpred.ros.messages import OCCUPIED, TAGS
from pedpred.ros.records import records
from pedpred.ros.writer import SCENE_RECORD
from pedpred.scenes import OccupancyMap, Scene
from pedpred.storage.scenes import tracks_of

_REMEDY = f"A recording is an MCAP file with {TYPES[MAP]} on {MAP} and {TYPES[PEOPLE]} on {PEOPLE}, in CDR"
_NOBODY = {name: np.zeros(0) for name in ("time_s", "track_id", "x_m", "y_m")}


def read_recording(path: Path) -> Scene:
    """The scene of a recording of `write_recording`, or of another one with the same topics and types.

    A recording that ends in the middle is read up to there, with a warning. Where no record of ours
    tells them, the name is the file's, the resolution the shortest decimal that the map's float can
    stand for, and the time between detections the median one.

    Raises:
        SourceError: no MCAP file, damaged, a topic is missing or carries another type, or what
            it says makes no scene.
    """
    rows: list[dict[str, Any]] = []
    found: dict[str, Any] = {}
    with translate_errors(lambda problem: SourceError(path, None, f"damaged, {problem}", _REMEDY)):
        for topic, content in _contents(path):
            found[topic] = content
            if topic == PEOPLE:
                rows += _rows(content, path)
    for topic in (MAP, PEOPLE):
        if topic not in found:
            raise SourceError(path, None, f"nothing on {topic}, only on {sorted(found)}", _REMEDY)
    about = found.get(SCENE_RECORD, {})
    with translate_errors(partial(SourceError, path, None, remedy=_REMEDY)):
        trajectories = tracks_of(pd.DataFrame(rows or _NOBODY), path)
        return Scene(
            about.get("name", path.stem),
            trajectories,
            occupancy_of(found[MAP], about.get("resolution_m")),
            float(about.get("detection_dt_s") or trajectories.usual_interval_s()),
        )


def _contents(path: Path) -> Iterator[tuple[str, Any]]:
    """What a scene needs, in the file's order: (topic, message) and (name, metadata)."""
    channels: dict[int, Channel] = {}
    schemas: dict[int, Schema] = {}
    decoders = DecoderFactory()
    for record in records(path):
        if isinstance(record, Schema):
            schemas[record.id] = _known(record)
        elif isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Metadata):
            yield record.name, record.metadata
        elif isinstance(record, Message):
            channel = channels[record.channel_id]
            if channel.topic in (MAP, PEOPLE):
                schema = schemas.get(channel.schema_id)
                decode = decoders.decoder_for(channel.message_encoding, schema)
                if schema is None or decode is None or schema.name != TYPES[channel.topic]:
                    kind = f"{schema.name if schema else None} ({channel.message_encoding})"
                    raise SourceError(path, None, f"{channel.topic} carries {kind}", _REMEDY)
                yield channel.topic, decode(record.data)
            else:
                yield channel.topic, None


def _known(schema: Schema) -> Schema:
    """The schema with the public definition of its type, where it is one of ours: a file cannot change it."""
    if schema.name not in TYPES.values():
        return schema
    return Schema(
        id=schema.id, name=schema.name, encoding=schema.encoding, data=definition(schema.name).encode()
    )


def _rows(message: Any, path: Path) -> list[dict[str, Any]]:
    """People of one message as rows of `tracks_table`.

    The stamp counts whole nanoseconds, a tag `time_s` is exact. Velocities that nobody knows are left out.
    """
    stamp = message.header.stamp
    rows = []
    for person in message.people:
        if not person.name.lstrip("-").isdecimal():
            raise SourceError(path, None, f"person {person.name!r} has no whole number for a name", _REMEDY)
        row = {"time_s": stamp.sec + stamp.nanosec / 1e9, "track_id": int(person.name)}
        row |= {"x_m": person.position.x, "y_m": person.position.y}
        if not np.isnan([person.velocity.x, person.velocity.y]).all():
            row |= {"vx_mps": person.velocity.x, "vy_mps": person.velocity.y}
        tags = zip(person.tagnames, person.tags, strict=True)
        rows.append(row | {name: float(text) for name, text in tags if name in TAGS})
    return rows


def occupancy_of(message: Any, resolution_m: str | None) -> OccupancyMap:
    """The map of nav_msgs/OccupancyGrid; unknown cells (-1) are free."""
    info = message.info
    turn = info.origin.orientation
    if turn.x or turn.y or turn.z:
        raise ValueRuleError(
            "origin.orientation", [turn.x, turn.y, turn.z, turn.w], "maps must not be turned"
        )
    cells = np.asarray(message.data).reshape(info.height, info.width).T
    origin = np.array([info.origin.position.x, info.origin.position.y])
    return OccupancyMap(cells > OCCUPIED / 2, origin, float(resolution_m or str(np.float32(info.resolution))))
