"""Messages from bytes, with an error that names the type."""

from __future__ import annotations

from typing import Any

from pedpred.errors import ValueRuleError
from pedpred.files import translate_errors
from pedpred.ros.decoding import Connection, Decoder

_decoder = Decoder()


def decode(raw: bytes, kind: str) -> Any:
    """Decode a message of a known type.

    Args:
        raw: CDR.
        kind: such as `people_msgs/msg/People`.

    Raises:
        ValueRuleError: the bytes are not a message of this type.
    """

    def wording(problem: str) -> ValueRuleError:
        rule = f"it must be a {kind}: does the publisher have another edition of its package? ({problem})"
        return ValueRuleError("message", f"{len(raw)} bytes", rule)

    with translate_errors(wording):
        return _decoder.decode(raw, Connection("", kind))
