"""What the columns of a table hold, by the words of their titles.

A title names a quantity (time, frame, id, x, y), perhaps its unit, and words that change nothing:
`time [ms]`, `pos_x_m`, `personID`, `x in cm`, `world x (ft)`. A title with any other word, such as `speed_x`
or `vehicle_id`, is that of a column that is not used.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pedpred.errors import ValueRuleError, worded
from pedpred.storage.tracks import TRACK_COLUMNS
from pedpred.tables.units import LENGTH_WORDS, PER_SECOND, PIXELS, TIME_WORDS

NAMES = {
    "time_s": ("t", "time", "time_s", "timestamp"),
    "frame": ("frame", "frame_id"),
    "track_id": ("id", "track", "track_id", "ped_id", "agent_id"),
    "x_m": ("x", "x_m", "pos_x"),
    "y_m": ("y", "y_m", "pos_y"),
}
"""Plain titles, also with a unit. Where one is there, other words for the same are not used."""

_COLUMN = {"time": "time_s", "frame": "frame", "id": "track_id", "who": "track_id", "x": "x_m", "y": "y_m"}
"""Quantity -> the column that a title with a word for it may be."""
_SHOWN, _LONGEST = 3, 200

LENGTHS = ("x_m", "y_m")
REST = "rest_of_time"
"""Times in a part of a second beside those in seconds: the rest of a stamp, or the same times again."""
LARGER = {"minute": 60, "hour": 3600}
"""Names of columns beside one of seconds, which count minutes and hours: how many seconds each has."""
PARTS = ("ms", "us", "ns")
_SAY = {
    "time": "t time times timestamp timestamps stamp datetime clock "
    "zeit uhrzeit zeitstempel zeitpunkt temps horodatage heure tiempo hora tijd",
    "frame": "frame frames bild fotogramma fotograma trame",
    "id": "id ids uid pid identifier identity identifiant identificador identificativo kennung",
    "who": "track tracklet trajectory traj ped pedestrian person agent actor object obj subject human "
    "participant walker people name fussganger fussgaenger objekt personen pieton personne objet peaton "
    "persona objeto pedone oggetto voetganger persoon pessoa pedestre",
    "x": "x easting east rechtswert",
    "y": "y northing north hochwert",
}
"""Words of English, and of German, French, Spanish, Italian, Dutch and Portuguese, without accents."""
_QUANTITY = {word: quantity for quantity, words in _SAY.items() for word in words.split()}
_PERSON = set(_SAY["who"].split()) - {"track", "tracklet", "trajectory", "traj", "agent", "actor", "object"}
_PERSON -= {"obj", "subject", "name", "objekt", "objet", "objeto", "oggetto"}
"""Words of `_SAY["who"]` that are said of nobody but people."""
_AXES = {*_SAY["x"].split(), *_SAY["y"].split()}
_FRAMES = {"world", "map", "local", "global", "ground", "utm", *_AXES} - {"x", "y"}
"""Words of a title that say in which frame positions are."""
_BESIDE = {
    "number": "number no nr num index idx nummer numero",
    "place": "pos position coord coords coordinate coordinates location loc center centre centroid point "
    "world map local global ground utm head pose est estimated filt filtered smooth smoothed koordinate "
    "coordonnee coordenada coordinata posicion posizione posicao",
    "clock": "timestep simulation sim unix epoch ros utc gmt local elapsed relative absolute header date tv "
    "datum",
}
_NUMBER, _PLACE, _CLOCK = (set(words.split()) for words in _BESIDE.values())
_CLASS, _APART = (
    set(words.split())
    for words in (
        "class classes category categories type types label labels kind classification klasse typ kategorie "
        "clase tipo categoria classe categorie",
        "scene run trial recording video session experiment scenario floor storey camera cam dataset "
        "sequence episode clip day hour topic log file filename source src take part "
        "level deck etage \u00e9tage niveau stockwerk geschoss ebene piso planta piano verdieping",
    )
)
_FLAGS = {
    word: of_nobody
    for words, of_nobody in (
        ("valid visible seen detected tracked present in_frame in_view person pedestrian human ped", False),
        ("lost outside missing occluded invalid out_of_frame out_of_view robot vehicle car", True),
    )
    for word in words.split()
}
"""Titles of columns that say whether somebody was seen, and what they hold where nobody was; perhaps with
`is` before them, which those about people or others need."""
_WHO = {"person", "pedestrian", "human", "ped", "robot", "vehicle", "car"}
_BOX = {"box", "bbox", "bb", *LENGTH_WORDS}
_SIDES, _DEEP = ({"w", "width"}, {"h", "height"}), {"l", "length", "depth"}
_CORNERS = {"left", "top", "xmin", "ymin", "min"}
"""Words for the sides of boxes in a picture, for the third side of those on the ground, and for corners.

Beside corners, x and y are something else.
"""
_CLASSED = {*_QUANTITY, "road", "user", "detection"} - {"t", "x", "y"}
_STEPS = {"step", "simulation", "sim"}
_FILLERS = {"in"}
_OF_IDS = {"id", *_SAY["who"].split()} - {"name"}
_TAGS = {"tag", "tracker", "badge", "mac", "device", "uuid", "guid", "entity", "user", "visitor", "customer"}
"""What people wear or are, or who tracks them: its number is their id where no title says more."""
_SORTS = {"unique", "global", "local", "tracked"}
"""What may stand before an id, likewise."""
_MINUTES = {"min", "mins", "minute", "minutes"}
_HOURS = {"h", "hr", "hrs", "hour", "hours"}
_LETTERS = {"m", "s"}  # no unit before another word without a sign between them
_DEGREES = {"lon", "lat", "lng", "long", "longitude", "latitude", "deg", "degree", "degrees"}
_KNOWN = {*_QUANTITY, *_NUMBER, *_PLACE, *_CLOCK, *_STEPS, *LENGTH_WORDS, *TIME_WORDS, *_FILLERS}
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|[^\W\d_]+")
_SIGN = re.compile(r"[^\w\s\-./()\[\]{}:,#]")
"""Signs that change what a title means, such as those of inches and degrees."""
_INCHES = re.compile(r"[(\[{]\s*in\s*[)\]}]", re.IGNORECASE)
_PROCESSOR = re.compile(r"-PID\d+$")
_FIELD, _UNNAMED = "field.", re.compile(r"Unnamed: \d+_level_\d+")
_SHORTEST_ALONE = 3
"""A unit of time may stand alone in a title (`sec`), but no letter or two (`s`), which may mean anything."""


@dataclass(frozen=True)
class Meaning:
    """What a column holds.

    Attributes:
        name: `frame`, or a column of `Trajectories`.
        unit: of lengths or times, where the title says it.
        plain: whether the title is one of `NAMES`, perhaps with a unit.
        whose: words of the title for who is there, such as `ped`.
    """

    name: str
    unit: str | None = None
    plain: bool = True
    whose: frozenset[str] = frozenset()


def meaning_of(title: str) -> Meaning | None:
    """What a column holds by its title; None: nothing that is used."""
    lower = title.strip().lower()
    if lower in TRACK_COLUMNS and lower not in NAMES:
        return Meaning(lower)
    words = _words(title)
    said = {_QUANTITY[word] for word in words if word in _QUANTITY}
    units = [word for word in words if word in LENGTH_WORDS or word in TIME_WORDS]
    if (
        not words
        or _SIGN.search(title)
        or len(units) > 1
        or not set(words) <= _KNOWN
        or len(set(words) - _PLACE) != sum(word not in _PLACE for word in words)
    ):
        return None
    name = _name(said, set(words), units)
    words_of_lengths = LENGTH_WORDS if name in LENGTHS else TIME_WORDS if name == "time_s" else {}
    if name is None or any(unit not in words_of_lengths for unit in units):
        return None
    core = "_".join(word for word in words if word not in units and word not in _FILLERS)
    whose = frozenset(word for word in words if _QUANTITY.get(word) == "who")
    return Meaning(name, words_of_lengths[units[0]] if units else None, core in NAMES[name], whose)


def columns_of_classes(titles: Sequence[str]) -> list[str]:
    """Titles of columns that may say what kind of road user a row is about, such as `object_class`."""
    return [title for title in titles if _is_called(title, _CLASS, _CLASSED)]


def columns_of_recordings(titles: Sequence[str]) -> list[str]:
    """Titles of columns that may say in which recording, on which floor, or in which minute, people are."""
    clock = _clock(meant := {title: meaning for title in titles if (meaning := meaning_of(title))})
    minutes = _MINUTES if clock == ("time_s", "s") else ()
    clocks = {title: m.name for title, m in meant.items() if (m.name, m.unit or "s") == clock}
    parts = _larger_parts(titles, clocks)
    return [
        title
        for title in titles
        if title not in parts
        and (_is_called(title, _APART, _NUMBER | {"id", "name", "path"}) or title.strip().lower() in minutes)
    ]


def columns_of_flags(titles: Sequence[str]) -> dict[str, bool]:
    """Titles of columns that say whether somebody was seen, and what they hold where nobody was."""
    flags = {}
    for title in titles:
        words = [part.lower() for part in _WORD.findall(title)]
        word = "_".join(words[words[:1] == ["is"] :])
        if word in _FLAGS and (words[0] == "is" or word not in _WHO):
            flags[title] = _FLAGS[word]
    return flags


def is_part_of_time(title: str) -> bool:
    """Whether a column may count days, hours or minutes of times that another one goes on with."""
    return bool({part.lower() for part in _WORD.findall(title)} & (_MINUTES | {"day", "hour"}))


def columns_of_heights(titles: Sequence[str], words: Sequence[str] = ("z", "depth")) -> list[int]:
    """Columns that a title calls z or depth, which may be the second axis of the ground instead of y."""
    beside = {*_PLACE, *LENGTH_WORDS, *_FILLERS}
    return [at for at, title in enumerate(titles) if _is_called(title, set(words), beside)]


def unit_in(title: str) -> str | None:
    """The unit of length in the title of any column."""
    return next((LENGTH_WORDS[word] for word in _words(title) if word in LENGTH_WORDS), None)


def _is_called(title: str, needed: set[str], beside: set[str]) -> bool:
    words = {part.lower() for part in _WORD.findall(title)}
    return bool(words & needed) and words <= needed | beside and meaning_of(title) is None


def _name(said: set[str], words: set[str], units: Sequence[str]) -> str | None:
    """The column that the quantities in a title mean, if its other words go with it."""
    if words - _NUMBER == {"timestep"} or ("step" in words and words <= _STEPS | _NUMBER | {"time"}):
        return "frame"
    axes = said & {"x", "y"}
    rest = words - set(_QUANTITY) - set(units) - _FILLERS
    if axes:
        fits = len(axes) == 1 and said <= {*axes, "who"} and rest <= _PLACE
        return f"{axes.pop()}_m" if fits else None
    if "frame" in said:
        return "frame" if said <= {"frame", "id"} and rest <= _NUMBER else None
    if "time" in said:
        return "time_s" if said <= {"time"} and rest <= _CLOCK else None
    if said:
        return "track_id" if rest <= _NUMBER else None
    alone = rest <= _CLOCK and len(units) == 1 and len(units[0]) >= _SHORTEST_ALONE and units[0] != "min"
    return "time_s" if alone and units[0] in TIME_WORDS else None


def _words(title: str) -> list[str]:
    """The words of a title in lower case without accents; an unknown one may be two (`xcm`, `trackid`)."""
    words: list[str] = []
    plain = (
        _INCHES.sub(r" inch ", title).replace("\u00b5", "u").replace("\u03bc", "u").replace("\u00df", "ss")
    )
    plain = "".join(sign for sign in unicodedata.normalize("NFKD", plain) if not unicodedata.combining(sign))
    for part in _WORD.findall(plain):
        word = part.lower()
        pairs = [(word[:k], word[k:]) for k in range(1, len(word)) if word[:k] not in _LETTERS]
        parts = [pair for pair in pairs if set(pair) <= _KNOWN]
        words += [word] if word in _KNOWN or len(parts) != 1 else parts[0]
    return words


def joined_titles(levels: Sequence[Sequence[str]]) -> list[str]:
    """One title for each column of a header with several rows; pandas numbers levels without a name."""
    return [
        " ".join(level for level in column if level and not _UNNAMED.fullmatch(level))
        for column in zip(*levels, strict=True)
    ]


def titles_of_fields(titles: Sequence[str]) -> list[str]:
    """Titles without what Vadere and `rostopic echo -p` write around fields; stamps of ROS are ns."""
    titles = [_PROCESSOR.sub("", title) for title in titles]
    first, others = titles[:1], titles[1:]
    if first != ["time"] or not others or not all(title.startswith(_FIELD) for title in others):
        return titles
    fields = (title.removeprefix(_FIELD) for title in others)
    return ["time [ns]", *(f"{title} [ns]" if title.endswith("stamp") else title for title in fields)]


def numbered_pairs(titles: Sequence[str]) -> list[tuple[str, str]]:
    """Columns of x and y that are called alike but for a number: of several people, or corners of boxes."""
    axes: dict[tuple[str, ...], dict[str, str]] = {}
    for title in titles:
        words = _words(title)
        axis = {"x", "y"} & set(words)
        if len(axis) == 1 and any(word.isdigit() for word in words):
            others = tuple(word for word in words if word not in axis)
            axes.setdefault(others, {}).setdefault(axis.pop(), title)
    return [(pair["x"], pair["y"]) for pair in axes.values() if len(pair) == 2]


def titles_of_tracks(titles: Sequence[str]) -> dict[str, str]:
    """Title -> name of the columns that hold tracks.

    Raises:
        ValueRuleError: one is missing or there twice.
    """
    meant = {title: meaning for title in titles if (meaning := meaning_of(title))}
    if not any(meaning.name == "track_id" for meaning in meant.values()):
        meant |= {title: Meaning("track_id") for title, m in meant.items() if m.name == "person_id"}
    if not any(meaning.name == "track_id" for meaning in meant.values()):
        meant |= {
            title: Meaning("track_id")
            for title in titles
            if _is_called(title, _TAGS | _OF_IDS, _NUMBER | _SORTS)
        }
    clock = _clock(meant)
    of_people = _pairs_of_people(meant)
    wanted: dict[str, str] = {}
    for name in ("time_s", "frame", *TRACK_COLUMNS[1:]):
        candidates = [title for title in titles if title in meant and meant[title].name == name]
        if name in ("time_s", "frame"):
            candidates = [title for title in candidates if (name, meant[title].unit or "s") == clock]
        for preferred in (
            lambda title: meant[title].unit != PIXELS,
            lambda title: title in of_people,
            lambda title: meant[title].plain,
            lambda title: "name" not in _words(title),
        ):
            candidates = [title for title in candidates if preferred(title)] or candidates
        if len(candidates) > 1:
            rule = f"columns {candidates[0]} and {candidates[1]} are both {name}"
            raise ValueRuleError("columns", titles, rule)
        wanted |= dict.fromkeys(candidates, name)
    if clock == ("time_s", "s"):
        wanted |= dict.fromkeys(_rest_of_stamp(meant), REST) | _larger_parts(titles, wanted)
    for name in (clock[0], "track_id", *LENGTHS):
        if name not in wanted.values():
            raise ValueRuleError("columns", titles, _missing(name, titles))
    return {title: wanted[title] for title in titles if title in wanted}


def other_pairs(titles: Sequence[str], wanted: Mapping[str, str]) -> list[tuple[str, str]]:
    """Titles of x and y that may be meant in place of those that are used.

    They are those of other people or things, or say a frame or a unit while those that are used say none.
    """
    meant = {title: meaning for title in titles if (meaning := meaning_of(title)) and meaning.name in LENGTHS}
    used = {title for title in wanted if title in meant}
    said = {word for title in used for word in _words(title)} & _FRAMES
    said |= {unit for title in used if (unit := meant[title].unit)}
    pairs = []
    for pair in _pairs(meant):
        more = {word for title in pair for word in _words(title)} & (_FRAMES | LENGTH_WORDS.keys())
        differs = meant[pair[0]].whose != frozenset().union(*(meant[title].whose for title in used))
        if not used & set(pair) and PIXELS not in {meant[title].unit for title in pair}:
            pairs += [pair] if differs or (more and not said) else []
    return pairs


def sides_of_boxes(titles: Sequence[str], wanted: Mapping[str, str]) -> list[tuple[str, str]]:
    """Titles of widths and heights beside x and y that may be corners or middles of boxes in a picture."""
    words = {title: {part.lower() for part in _WORD.findall(title)} - _BOX for title in titles}
    free = [title for title in titles if title not in wanted]
    sides = [[title for title in free if words[title] and words[title] <= side] for side in _SIDES]
    if any(words[title] <= _DEEP or words[title] & _CORNERS for title in free if words[title]):
        return []
    return [(width, height) for width, height in zip(*sides, strict=False)]


def _pairs(meant: Mapping[str, Meaning]) -> list[tuple[str, str]]:
    """Columns of x and y whose titles have the same unit and words for who is there."""
    axes = {name: [title for title, m in meant.items() if m.name == name] for name in LENGTHS}
    return [
        (x, y)
        for x in axes["x_m"]
        for y in axes["y_m"]
        if (meant[x].unit, meant[x].whose) == (meant[y].unit, meant[y].whose)
        and set(_words(x)) - _AXES == set(_words(y)) - _AXES
    ]


def _pairs_of_people(meant: Mapping[str, Meaning]) -> set[str]:
    """Titles of x and y that say that they are those of people: by a word for these, or of the ids' title."""
    of_ids = frozenset().union(*(m.whose for m in meant.values() if m.name == "track_id"))
    return {title for pair in _pairs(meant) if meant[pair[0]].whose & (_PERSON | of_ids) for title in pair}


def _clock(meant: dict[str, Meaning]) -> tuple[str, str]:
    """Name and unit of the clock that is used: the coarsest of the times before frame numbers."""
    said = {(meaning.name, meaning.unit or "s") for meaning in meant.values()}
    clocks = [*(("time_s", unit) for unit in PER_SECOND), ("frame", "s")]
    return next((clock for clock in clocks if clock in said), clocks[0])


def naming(columns: str = "") -> str:
    """What names all columns in order, such as these: an option, or an attribute of a data frame."""
    attribute = f"table.columns = {columns.split(',')}" if columns else "table.columns"
    return worded(f"--columns {columns}".rstrip(), attribute)


def _rest_of_stamp(meant: dict[str, Meaning]) -> list[str]:
    """The only column of times in a part of a second beside one in seconds."""
    units = [(title, m.unit) for title, m in meant.items() if m.name == "time_s" and m.unit in PARTS]
    return [title for title, _ in units] if len(units) == 1 else []


def _larger_parts(titles: Sequence[str], wanted: Mapping[str, str]) -> dict[str, str]:
    """Title -> name of the columns of minutes, and then of hours, beside one that is called seconds."""
    if not any(name == "time_s" and set(_words(title)) <= set(TIME_WORDS) for title, name in wanted.items()):
        return {}
    parts: dict[str, str] = {}
    for name, words in zip(LARGER, (_MINUTES, _HOURS), strict=True):
        called = [title for title in titles if title not in wanted and title.strip().lower() in words]
        if len(called) != 1:
            break
        parts[called[0]] = name
    return parts


def _missing(name: str, titles: Sequence[str]) -> str:
    kinds = ("time_s", "frame") if name in ("time_s", "frame") else (name,)
    aliases = ", ".join(alias for kind in kinds for alias in NAMES[kind])
    rule = f"no column for {name}, which may be called {aliases}"
    listed = " | ".join(titles)[:200]
    if name in LENGTHS and (degrees := [title for title in titles if _DEGREES & set(_words(title))]):
        return f"{rule}. {degrees[0]} is in degrees: project positions to metres first. There are {listed}"
    one = " (if all rows are about one person, add a column id)" if name == "track_id" else ""
    separators = worded("; commas, semicolons, tabs, | or blanks separate columns", "")
    return f"{rule}{one}. There are {listed}{separators}{_unclear(kinds, titles)}"


def _unclear(names: Sequence[str], titles: Sequence[str]) -> str:
    """Which titles have a word for one of these columns, and which unknown word; empty: none has."""
    said = {quantity for quantity, name in _COLUMN.items() if name in names}
    reasons = []
    for title in titles:
        words = _words(title)
        others = [word for word in words if word not in _KNOWN]
        if others and not said.isdisjoint(_QUANTITY.get(word) for word in words):
            reasons.append(f"{title} because of {others[0]!r}")
    shown = ", ".join(reasons[:_SHOWN])[:_LONGEST]
    return f". Not used: {shown}" if shown else ""
