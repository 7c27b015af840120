"""Who is a person: by a word for one in the class of a detection, or in a column of a table."""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Mapping
from pathlib import Path

from pedpred.errors import SourceError, brief, worded
from pedpred.tables.missing import MISSING

PERSON_CLASSES = ("person", "people", "pedestrian", "human")
"""The classes that are people, unless others are wanted."""
_FORMS = (
    *("ped", "peds", "persons", "pedestrians", "humans", "adult", "adults", "child", "children", "walker"),
    *("fussg\u00e4nger", "fussgaenger", "fussganger", "personen", "pi\u00e9ton", "pieton", "personne"),
    *("peat\u00f3n", "peaton", "persona", "pedone", "voetganger", "persoon"),
)
"""Further words for them in tables."""
_WORD = re.compile(r"[^\W\d_]+")
_MOST_CLASSES = 50
"""A column with more different words holds something else, such as names."""
_TOLD = 5
_log = logging.getLogger(__name__)


def is_person(label: str, wanted: Collection[str] = PERSON_CLASSES) -> bool:
    """Whether a class is one of those wanted: itself, or a word in it as in `human.pedestrian`.

    Args:
        label: the class; where it is empty, nobody says that it is no person.
        wanted: classes, in small or capital letters; without any but empty ones, all are persons.
    """
    names = {name.casefold() for name in wanted} - {""}
    folded = label.casefold()
    return not names or not folded or folded in names or not names.isdisjoint(_WORD.findall(folded))


def label_of(field: str) -> str:
    """The class in a field; empty where it is missing."""
    label = field.strip()
    return "" if label.lower() in MISSING else label


def classes_of_people(
    path: Path, counts: Mapping[str, Mapping[str, int]], wanted: Collection[str] = ()
) -> tuple[str, set[str]] | None:
    """Find out which rows of a table are about people; what is left out, or stays open, is logged.

    Args:
        path: the file, for messages.
        counts: title of a column of classes -> class -> number of its rows.
        wanted: who is a person; empty: whoever is called so in any of the columns.

    Returns:
        The column that says so, and the classes in it that are people; None: all rows count.

    Raises:
        SourceError: classes are wanted, and no column has them.
    """
    columns = {title: {one for one in values if one} for title, values in counts.items()}
    columns = {title: values for title, values in columns.items() if len(values) <= _MOST_CLASSES}
    for title, classes in columns.items():
        people = {one for one in classes if is_person(one, wanted or (*PERSON_CLASSES, *_FORMS))}
        if people:
            others = sorted(classes - people, key=lambda one: -counts[title][one])
            if others:
                listed = ", ".join(f"{counts[title][one]} of {one!r}" for one in others[:_TOLD])
                more = ", ..." * (len(others) > _TOLD)
                text = "%s: column %s: rows that are about no people are left out: %s%s"
                _log.warning(text, path, title, listed, more)
            return title, people | {""}
    if wanted:
        listed = f"the columns of classes hold {brief({t: sorted(values) for t, values in columns.items()})}"
        problem = f"no row is of class {', '.join(wanted)}; {listed if columns else 'no column has classes'}"
        raise SourceError(
            path, None, problem, worded("Name a class that is there, or leave --class out", "Give all rows")
        )
    for title, classes in columns.items():
        if len(classes) > 1 or not all(one.isdecimal() for one in classes):
            choice = worded("--class chooses", "leave out the rows of others")
            text = f"%s: column %s holds %s, no words for people: all rows are read; {choice}"
            _log.warning(text, path, title, ", ".join(sorted(classes)[: 2 * _TOLD]))
    return None
