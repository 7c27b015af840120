"""What readers of every storage of bags have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

from pedpred.ros.bag_files import BagFile
from pedpred.ros.decoding import Connection, Decoder


class BagReader(ABC):
    """The files of one bag; rosbags decodes the messages."""

    def __init__(self, files: Sequence[BagFile]):
        self._files, self._decoder = files, Decoder()

    @cached_property
    def connections(self) -> list[Connection]:
        """Every topic, once; reads the files."""
        return list(dict.fromkeys(one for file in self._files for one in self._connections(file)))

    def messages(self, connections: Sequence[Connection] = ()) -> Iterator[tuple[Connection, int, bytes]]:
        """Topic, time (ns) and bytes of messages of some connections (default: all), as they were written."""
        for file in self._files:
            yield from self._messages(file, connections)

    def decode(self, raw: bytes, connection: Connection) -> Any:
        """The message; see `Decoder.decode`."""
        return self._decoder.decode(raw, connection)

    @abstractmethod
    def _connections(self, file: BagFile) -> Iterator[Connection]:
        """The topics of a file; their definitions are noted."""

    @abstractmethod
    def _messages(
        self, file: BagFile, connections: Sequence[Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """The messages of a file, see `messages`."""


class RecordReader(BagReader):
    """Files that are one record after the other, the topics among the messages."""

    def _connections(self, file: BagFile) -> Iterator[Connection]:
        return (connection for connection, _, raw in self._walk(file) if raw is None)

    def _messages(
        self, file: BagFile, connections: Sequence[Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        for connection, time_ns, raw in self._walk(file):
            if raw is not None and (connection in connections or not connections):
                yield connection, time_ns, raw

    @abstractmethod
    def _walk(self, file: BagFile) -> Iterator[tuple[Connection, int, bytes | None]]:
        """Every topic (without bytes) and every message of a file."""
