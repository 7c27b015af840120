"""Who is a person: by a word for one in the class of a detection, or in a column of a table."""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Mapping, Sequence
from itertools import takewhile
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
_OTHERS = {
    word
    for words in (
        "car cars auto automobile vehicle vehicles truck trucks lorry bus buses tram train forklift trolley",
        "bike bikes bicycle bicycles cycle cyclist cyclists bicyclist motorcycle motorcycles motorcyclist",
        "motorbike moped scooter scooters robot robots ego rider driver dog animal pkw lkw fahrrad radfahrer",
        "fahrzeug roboter voiture velo cycliste camion coche bici bicicleta ciclista macchina fiets fietser",
    )
    for word in words.split()
}
"""Words for road users and robots that are not people, which a class of people does not have."""
_THINGS = {*_OTHERS, "mover", "carrier", "crossing", "crosswalk", "light", "signal", "sign", "zone", "bridge"}
_THINGS |= {"area", "path", "statue", "mannequin", "dummy", "poster", "picture"}
_NEGATIONS = {"not", "non", "no", "kein", "keine", "nicht"}
_BESIDE = {"with", "without", "pushing", "pulling", "walking", "carrying", "holding", "near"}
"""What follows in the class of somebody is not said of who it is, as in `pedestrian with bike`."""
_WORD = re.compile(r"[^\W\d_]+")
_MOST_CLASSES = 50
"""A column with more different words holds something else, such as names."""
_STEADY = 0.9
"""The share of people who keep their class, where the title does not say that it is one."""
_NAMED = {*PERSON_CLASSES, *_FORMS}
_TOLD = 5
_log = logging.getLogger(__name__)


def is_person(label: str, wanted: Collection[str] = PERSON_CLASSES) -> bool:
    """Whether a class is one of those wanted: itself, or a word in it as in `human.pedestrian`.

    Words for other road users and things, and negations, say that it is not (`person_on_bike`,
    `non-pedestrian`).

    Args:
        label: the class; where it is empty, nobody says that it is no person.
        wanted: classes, in small or capital letters; without any but empty ones, all are persons.
    """
    names = {name.casefold() for name in wanted} - {""}
    folded = label.casefold()
    if not names or not folded or folded in names:
        return True
    said = set(takewhile(lambda word: word not in _BESIDE, _first_named(folded, names)))
    excluded = _NEGATIONS | _THINGS if names.isdisjoint(_THINGS) else _NEGATIONS
    return not names.isdisjoint(said) and said.isdisjoint(excluded)


def _first_named(label: str, names: set[str]) -> list[str]:
    """The words of a class up to the first alternative with a name, as in `pedestrian/bicycle`."""
    words: list[str] = []
    for part in label.split("/"):
        words += _WORD.findall(part)
        if not names.isdisjoint(words):
            break
    return words


def label_of(field: str) -> str:
    """The class in a field; empty where it is missing."""
    label = field.strip()
    return "" if label.lower() in MISSING else label


def may_hold_classes(fields: Collection[str]) -> bool:
    """Whether the values of a column are few, and one is a word for people or for other road users."""
    labels = {label_of(field).casefold() for field in fields}
    words = {word for label in labels for word in _WORD.findall(label)}
    return len(labels) <= _MOST_CLASSES and not words.isdisjoint(_NAMED | _OTHERS)


def are_classes(path: Path, title: str, labels: Mapping[str, set[str]], wanted: Collection[str]) -> bool:
    """Whether a column says what kind of road user each row is about, by what it holds.

    Some values are words for people, and others for other road users, or some are classes that are wanted;
    and each keeps its own. Values that change are warned about: they may be those of something else.

    Args:
        path: the file, for messages.
        title: of the column.
        labels: id -> the values in its rows.
        wanted: who is a person; empty: whoever is called so.
    """
    values = set().union(*labels.values()) - {""}
    people = {one for one in values if is_person(one, wanted or _NAMED)}
    others = {one for one in values - people if not _OTHERS.isdisjoint(_WORD.findall(one.casefold()))}
    if len(values) > _MOST_CLASSES or not people or not (wanted or others):
        return False
    steady = sum(len(each) == 1 for each in labels.values()) >= _STEADY * len(labels)
    if not steady and not wanted:
        text = "%s: column %s holds words for people and for others (%s), which change: all rows are read; %s"
        choose = worded("--class chooses if they are classes", "leave out rows of others if they are classes")
        _log.warning(text, path, title, ", ".join(sorted(values)[:_TOLD]), choose)
    return steady or bool(wanted)


def people_by_ids(
    path: Path, title: str, counts: Mapping[str, int], wanted: Collection[str] = ()
) -> tuple[str, set[str]] | None:
    """Find out who is a person by the first words of ids, such as `ped_1` and `car_2`.

    Args:
        path: the file, for messages.
        title: of the column of ids.
        counts: id -> number of its rows.
        wanted: who is a person; empty: whoever is called so.

    Returns:
        The title, and the ids of people; None: all rows count.
    """
    words = {one: _first_word(one) for one in counts}
    named = wanted or _NAMED
    people = {one for one, word in words.items() if word and is_person(word, named)}
    others = [one for one, word in words.items() if word in _OTHERS and one not in people]
    others = [one for one in counts if one not in people] if wanted else others
    if not others or (wanted and not people):
        return None
    shown = ", ".join(others[:_TOLD]) + ", ..." * (len(others) > _TOLD)
    if not people:
        text = "%s: column %s: ids begin with words for no people (%s), and all rows are read"
        _log.warning(text, path, title, shown)
        return None
    text = "%s: column %s: rows whose ids begin with words for no people are left out: %s (%d rows)"
    _log.warning(text, path, title, shown, sum(counts[one] for one in others))
    return title, set(counts) - set(others)


def may_name_classes(ids: Sequence[str]) -> bool:
    """Whether some ids begin with a word for people or for other road users."""
    return not (_NAMED | _OTHERS).isdisjoint(map(_first_word, ids))


def _first_word(name: str) -> str:
    """The letters that an id begins with, in small ones."""
    begin = _WORD.match(name.strip().casefold())
    return begin[0] if begin else ""


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
        people = {one for one in classes if is_person(one, wanted or _NAMED)}
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
