"""A bag as its topics and decoded messages."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

from pedpred.errors import PedpredError, brief
from pedpred.reading.errors import add_path
from pedpred.ros.bag_files import open_files
from pedpred.ros.decoding import Connection, Decoder
from pedpred.ros.storages import Choice, read_messages

_log = logging.getLogger(__name__)


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a file, or the folder of a bag, until the block ends; see `open_files` for errors."""
    with open_files(path) as files:
        yield Bag(path, files)


class Bag:
    """The files of one bag.

    Args:
        path: of the bag.
        files: name and content of each file.
    """

    def __init__(self, path: Path, files: Sequence[tuple[Path, Path]]):
        self._path, self._files, self._decoder = path, files, Decoder()
        self._truncated = set[Path]()

    @cached_property
    def connections(self) -> list[Connection]:
        """Every topic with its type, once; reads the files."""
        found: dict[Connection, None] = {}
        for _ in self._read(lambda connection: found.setdefault(connection) is not None):
            pass
        return list(found)

    def messages(self, connections: Collection[Connection]) -> Iterator[tuple[Connection, int, Any]]:
        """Connection, time of arrival in ns, and decoded message, in the order of the files.

        Messages that cannot be decoded are left out with a warning.

        Raises:
            Exception: all messages of a topic cannot be decoded; see `pedpred.files.translate_errors`.
            ValueRuleError: a message would unpack to too much.
        """
        counts, damaged, causes = Counter[str](), Counter[str](), dict[str, Exception]()
        for connection, received_ns, raw in self._read(connections.__contains__):
            topic = connection.topic
            counts[topic] += 1
            try:
                message = self._decoder.decode(raw, connection)
            except PedpredError:
                raise
            except Exception as error:  # whatever rosbags raises on damaged bytes
                damaged[topic] += 1
                causes.setdefault(topic, error)
            else:
                yield connection, received_ns, message
        for topic, cause in causes.items():
            if damaged[topic] == counts[topic]:
                raise cause
            text = "%s: left out: %d of %d messages on %s, which are damaged (%s)"
            _log.warning(text, self._path, damaged[topic], counts[topic], topic, brief(str(cause)))

    def _read(self, choose: Choice) -> Iterator[tuple[Connection, int, bytes]]:
        """All chosen messages."""
        for name, content in self._files:
            with add_path(name):
                is_truncated = yield from read_messages(content, self._decoder, choose)
            if is_truncated and name not in self._truncated:
                self._truncated.add(name)
                _log.warning("%s is truncated: it is read up to its last whole chunk", name)
