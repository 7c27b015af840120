"""Which classes of detections are people: whomever a robot may hit."""

from __future__ import annotations

import re
from collections.abc import Collection

PERSON_CLASSES = (
    *("person", "people", "pedestrian", "human", "ped", "child", "adult", "wheelchair", "stroller"),
)
"""Words of classes that are people, unless others are wanted."""
_WORD = re.compile(r"[^\W\d_]+")


def is_person(label: str, wanted: Collection[str] = PERSON_CLASSES) -> bool:
    """Whether a class is one of those wanted, or a word in it is, as in `human.pedestrian.adult`.

    Args:
        label: the class; where it is empty, nobody says that it is no person.
        wanted: classes, in small or capital letters; without any but empty ones, all are persons.
    """
    names = {name.casefold() for name in wanted} - {""}
    folded = label.strip().casefold()
    return not names or not folded or folded in names or not names.isdisjoint(_WORD.findall(folded))
