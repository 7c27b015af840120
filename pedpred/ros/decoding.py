"""Messages of a bag decoded by the definitions that it brings, or by those that are known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.msg import normalize_msgtype

from pedpred.ros.message_types import known_editions

CDR, ROS1 = "cdr", "ros1"
_IDL_PART = "=" * 80 + "\n"
_ZSTD = b"\x28\xb5\x2f\xfd"
"""First bytes of zstd; those of CDR are zero, so they show whether a message is compressed."""


@dataclass(frozen=True)
class Connection:
    """A topic and the type of its messages.

    Attributes:
        topic: its name.
        msgtype: such as `people_msgs/msg/People`, also of ROS 1.
        encoding: of its messages; `CDR` and `ROS1` are decoded.
    """

    topic: str
    msgtype: str
    encoding: str = CDR

    @classmethod
    def of(cls, topic: str, msgtype: str, encoding: str) -> Connection:
        """The connection of a topic whose type may be named as in ROS 1."""
        return cls(topic, normalize_msgtype(msgtype) if encoding == ROS1 else msgtype, encoding)


class Decoder:
    """Decodes messages; definitions are parsed when the first message of their type is."""

    def __init__(self) -> None:
        self._types = get_typestore(Stores.EMPTY)
        self._texts: dict[str, tuple[str, str]] = {}

    def define(self, msgtype: str, encoding: str, text: str) -> None:
        """Note the definition that a bag brings of a type: the first one that is not empty.

        Args:
            msgtype: the type, see `Connection`.
            encoding: of the definition: ros1msg, ros2msg or ros2idl.
            text: the definition, with those of the types in it.
        """
        if text.strip():
            self._texts.setdefault(msgtype, (encoding, text))

    def decode(self, raw: bytes, connection: Connection) -> Any:
        """The message.

        Raises:
            Exception: it does not fit its definition; see `pedpred.files.translate_errors`.
        """
        kind, encoding = connection.msgtype, connection.encoding
        if encoding == CDR and raw[:4] == _ZSTD:
            from pedpred.ros.unpacking import unpack  # late: messages in files only

            raw = unpack(raw, "zstd")
        problem: Exception = KeyError(f"a definition of {kind}")
        for types in self._stores(kind, encoding):
            try:
                if encoding == ROS1:
                    return types.deserialize_ros1(raw, kind)
                return types.deserialize_cdr(raw, kind)
            except Exception as cause:  # whatever rosbags raises on a message of another edition
                problem = cause
        raise problem

    def _stores(self, kind: str, encoding: str) -> Iterator[Any]:
        if kind not in self._texts:
            yield from (types for types in known_editions(encoding == ROS1) if kind in types.fielddefs)
            return
        if kind not in self._types.fielddefs:
            self._register(kind, *self._texts[kind])
        yield self._types

    def _register(self, kind: str, encoding: str, text: str) -> None:
        if encoding in ("ros2msg", "ros1msg"):
            self._types.register(get_types_from_msg(text, kind))
            return
        for part in text.split(_IDL_PART):
            self._types.register(get_types_from_idl(part.partition("\n")[2] if _IDL_PART in text else part))
