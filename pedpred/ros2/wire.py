"""Messages from bytes, with an error that names the type."""

from __future__ import annotations

from typing import Any

from pedpred.errors import ValueRuleError
from pedpred.files import translate_errors
from pedpred.ros.message_types import deserialize


def decode(raw: bytes, kind: str) -> Any:
    """Decode a message of a known type, such as `people_msgs/msg/People`.

    Raises:
        ValueRuleError: the bytes are not a message of this type.
    """
    rule = f"it must be a {kind}: does the publisher have another edition of its package?"
    with translate_errors(lambda text: ValueRuleError("message", f"{len(raw)} bytes", f"{rule} ({text})")):
        return deserialize(raw, kind)
