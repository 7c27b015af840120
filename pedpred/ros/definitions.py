"""Definitions of messages that are not among the types of a ROS distribution, for bags that contain none.

The files in `messages` hold editions of packages, in ROS's own notation. Bags do not say which edition they
were written with: the first one that fits a message to its last byte is taken.
"""

from __future__ import annotations

from pathlib import Path

_FOLDER = Path(__file__).with_name("messages")


def _read(name: str) -> dict[str, str]:
    """Type -> definition of the messages in a file, in which each begins with `MSG: package/Name`."""
    parts = (part.partition("\n") for part in f"\n{(_FOLDER / name).read_text()}".split("\nMSG: ")[1:])
    return {title.replace("/", "/msg/"): fields for title, _, fields in parts}


_LATEST = _read("edition_1.msg")

EDITIONS = (_LATEST, _LATEST | _read("edition_2.msg"), _LATEST | _read("edition_3.msg"))
"""Type -> definition in each edition, the latest first."""
