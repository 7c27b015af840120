"""Bags of ROS 2 in MCAP files, read record by record within bounds; their messages decoded by rosbags."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from mcap.records import Channel, Message, Schema
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from pedpred.errors import SourceError
from pedpred.files import read_yaml
from pedpred.ros.records import records

_IDL_PART = "=" * 80 + "\n"
_REMEDY = "Record it with `ros2 bag record`, or repair it with the `mcap` command line tool"


@dataclass(frozen=True)
class Carrier:
    """A topic and the type of its messages."""

    topic: str
    msgtype: str


class McapBag:
    """What `read_bag` needs of a bag, as rosbags' own readers offer it.

    Attributes:
        connections: every topic that carries CDR messages, once.
    """

    def __init__(self, files: Sequence[Path]):
        self._files = files
        self._definitions: dict[str, Schema] = {}
        found = (carrier for file in files for carrier, _, _ in self._walk(file))
        self.connections = list(dict.fromkeys(found))
        self._types = get_typestore(Stores.EMPTY)

    def messages(self, connections: Collection[Carrier]) -> Iterator[tuple[Carrier, int, bytes]]:
        """Topic, time, ns, and bytes of every message on some topics, in the order of the files."""
        for kind in dict.fromkeys(carrier.msgtype for carrier in connections):
            self._learn(kind)
        for file in self._files:
            for carrier, time_ns, raw in self._walk(file):
                if raw is not None and carrier in connections:
                    yield carrier, time_ns, raw

    def deserialize(self, raw: bytes, msgtype: str) -> Any:
        """A message of a type that `messages` was asked for."""
        return self._types.deserialize_cdr(raw, msgtype)

    def _walk(self, file: Path) -> Iterator[tuple[Carrier, int, bytes | None]]:
        """Every channel (no bytes) and every message of a file."""
        schemas: dict[int, Schema] = {}
        carriers: dict[int, Carrier] = {}
        for record in records(file):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel) and record.message_encoding == "cdr":
                schema = schemas[record.schema_id]
                self._definitions.setdefault(schema.name, schema)
                carriers[record.id] = Carrier(record.topic, schema.name)
                yield carriers[record.id], 0, None
            elif isinstance(record, Message) and record.channel_id in carriers:
                yield carriers[record.channel_id], record.log_time, record.data

    def _learn(self, kind: str) -> None:
        """Know a type as the file defines it, or as ROS 2 Humble does where the file says nothing."""
        schema = self._definitions[kind]
        text = schema.data.decode()
        if not text:
            self._types.register(get_typestore(Stores.ROS2_HUMBLE).fielddefs)
        elif schema.encoding == "ros2msg":
            self._types.register(get_types_from_msg(text, kind))
        else:
            for part in text.split(_IDL_PART):
                self._types.register(
                    get_types_from_idl(part.partition("\n")[2] if _IDL_PART in text else part)
                )


def mcap_files(path: Path) -> list[Path]:
    """The MCAP files of a bag: the file itself, or those that a folder's metadata.yaml names; none of others.

    Raises:
        SourceError: the folder's description is damaged, or the files are compressed as a whole.
    """
    if not path.is_dir():
        return [path] if path.suffix == ".mcap" else []
    about = read_yaml(path / "metadata.yaml", partial(SourceError, path, None, remedy=_REMEDY))
    bag = about["rosbag2_bagfile_information"]
    if bag["storage_identifier"] != "mcap":
        return []
    if bag.get("compression_mode"):
        mode = bag["compression_mode"]
        raise SourceError(path, None, f"its messages or files are compressed one by one ({mode})", _REMEDY)
    return [path / Path(name).name for name in bag["relative_file_paths"]]
