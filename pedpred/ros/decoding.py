"""Decode messages of a bag by the definitions that it contains, or else by the known ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.msg import normalize_msgtype

from pedpred.ros.message_types import deserialize
from pedpred.ros.unpacking import unpack

CDR, ROS1 = "cdr", "ros1"
_IDL_PART = "=" * 80 + "\n"
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of a compressed message; those of CDR are zero."""


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
    encoding: str

    @classmethod
    def of(cls, topic: str, msgtype: str, encoding: str) -> Connection:
        """The connection of a topic whose type may be named as in ROS 1."""
        return cls(topic, normalize_msgtype(msgtype) if encoding == ROS1 else msgtype, encoding)

    @property
    def can_be_decoded(self) -> bool:
        """Whether the encoding is a known one."""
        return self.encoding in (CDR, ROS1)


class Decoder:
    """Decodes messages; the definition of a type is parsed at its first message."""

    def __init__(self) -> None:
        self._types = get_typestore(Stores.EMPTY)
        self._texts: dict[str, tuple[str, str]] = {}

    def define(self, msgtype: str, encoding: str, text: str) -> None:
        """Store the definition of a type; the first one that is not empty counts.

        Args:
            msgtype: the type, see `Connection`.
            encoding: of the definition: ros1msg, ros2msg or ros2idl.
            text: the definition, with those of the types in it.
        """
        if text.strip():
            self._texts.setdefault(msgtype, (encoding, text))

    def decode(self, raw: bytes, connection: Connection) -> Any:
        """Decode a message.

        Raises:
            Exception: it does not fit its definition; see `pedpred.files.translate_errors`.
        """
        kind, ros1 = connection.msgtype, connection.encoding == ROS1
        if not ros1 and raw[:4] == _ZSTD_MAGIC:
            raw = unpack(raw, "zstd")
        if kind not in self._texts:
            return deserialize(raw, kind, ros1)
        if kind not in self._types.fielddefs:
            self._register(kind, *self._texts[kind])
        return self._types.deserialize_ros1(raw, kind) if ros1 else self._types.deserialize_cdr(raw, kind)

    def _register(self, kind: str, encoding: str, text: str) -> None:
        if encoding in ("ros2msg", "ros1msg"):
            self._types.register(get_types_from_msg(text, kind))
            return
        for part in text.split(_IDL_PART):
            self._types.register(get_types_from_idl(part.partition("\n")[2] if _IDL_PART in text else part))
