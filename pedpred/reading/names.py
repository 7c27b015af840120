"""Ids of tracks: whole numbers, or names; in memory, tracks have numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pedpred.errors import brief
from pedpred.reading.errors import ContentError
from pedpred.reading.text import MISSING

_WHOLE = re.compile(r"-?[0-9]{1,19}")
_LONGEST_NAME, _MOST_NAMES = 200, 500_000
_OTHER_COLUMN = "Ids are whole numbers or words. If another column holds them: --columns id=TITLE"


@dataclass
class TrackNames:
    """Names of tracks.

    Attributes:
        of_number: number of a track -> its name; tracks that are not in it are called by their numbers.
    """

    of_number: dict[int, str] = field(default_factory=dict)

    def add(self, names: Iterable[str]) -> None:
        """Add the names of the tracks 0, 1, 2, ..."""
        self.of_number.update(enumerate(names))

    def column(self, track_id: np.ndarray) -> np.ndarray:
        """Name tracks: by their numbers, or by text where some have names.

        Args:
            track_id: [M] int64

        Returns:
            [M] int64, or objects.
        """
        if not self.of_number:
            return track_id
        numbers, inverse = np.unique(track_id, return_inverse=True)
        names = np.array([self.of_number.get(n, str(n)) for n in numbers.tolist()], dtype=object)
        called: np.ndarray = names[inverse]
        return called

    def numbers(self, written: Sequence[str]) -> list[int | None]:
        """Find the tracks that ids of another file mean.

        A whole number that is no name means the track with that number, unless that track has a name, and
        some other id is one.

        Args:
            written: ids.

        Returns:
            Their numbers; None: no track is called so.
        """
        number_of = {name: number for number, name in self.of_number.items()}
        some = any(name in number_of for name in written)
        numbers = []
        for name in written:
            number = number_of.get(name)
            if number is None and is_whole(name) and not (some and int(name) in self.of_number):
                number = int(name)
            numbers.append(number)
        return numbers


def is_whole(text: str) -> bool:
    """Whether a text is a whole number of 64 bits in its usual form, which can be restored from its value."""
    return bool(_WHOLE.fullmatch(text)) and str(int(text)) == text and -(2**63) <= int(text) < 2**63


def is_missing(column: pa.ChunkedArray) -> np.ndarray:
    """Which values of a column of text or numbers are missing. [M] bool."""
    values = column.combine_chunks()
    if pa.types.is_string(values.type) or pa.types.is_large_string(values.type):
        values = values.dictionary_encode()
    if pa.types.is_dictionary(values.type):
        texts = [
            text if str(text).strip().lower() not in MISSING else None
            for text in values.dictionary.to_pylist()
        ]
        values = pc.take(pa.array(texts), values.indices)
    return np.asarray(pc.is_null(values, nan_is_null=True).to_numpy(zero_copy_only=False), bool)


def number_ids(column: pa.ChunkedArray, missing: np.ndarray) -> tuple[np.ndarray, TrackNames]:
    """Number ids: whole numbers keep their values; words are numbered in the order of appearance.

    Args:
        column: ids, as text or numbers.
        missing: rows without one, or with one that does not count. [M] bool

    Returns:
        [M] int64, arbitrary where an id is missing; and the names of the tracks.

    Raises:
        ContentError: ids are numbers with fractions, too long or too many.
    """
    encoded = column.combine_chunks()
    encoded = encoded if pa.types.is_dictionary(encoded.type) else encoded.dictionary_encode()
    place = encoded.indices.fill_null(0).to_numpy(zero_copy_only=False)
    if len(encoded.dictionary) > _MOST_NAMES:
        raise ContentError(f"{len(encoded.dictionary)} different ids, at most {_MOST_NAMES}", _OTHER_COLUMN)
    used, first = np.unique(place[~missing], return_index=True)
    written = [_id_text(value) for value in encoded.dictionary.take(pa.array(used)).to_pylist()]
    of_place = np.zeros(max(1, len(encoded.dictionary)), np.int64)
    names = TrackNames()
    if all(map(is_whole, written)):
        of_place[used] = list(map(int, written))
    else:
        called = list(dict.fromkeys(written[k] for k in np.argsort(first)))
        _check_names(called)
        names.add(called)
        number_of = {name: number for number, name in names.of_number.items()}
        of_place[used] = [number_of[name] for name in written]
    return of_place[place], names


def _id_text(value: object) -> str:
    """An id as text; whole numbers have no point, as in `1.0` and `1.0000000e+00`."""
    text = str(value).strip()
    try:
        return str(int(float(text))) if "." in text and "_" not in text and float(text).is_integer() else text
    except ValueError:
        return text


def _check_names(names: Sequence[str]) -> None:
    """Check that ids are names, not numbers with fractions.

    Raises:
        ContentError: they are not.
    """
    if long := [text for text in names if len(text) > _LONGEST_NAME]:
        raise ContentError(f"an id of {len(long[0])} characters, expected at most {_LONGEST_NAME}")
    try:
        fractions = [text for text in names if not float(text).is_integer()]
    except (ValueError, OverflowError):
        return
    if fractions:
        raise ContentError(f"id = {brief(fractions[0])} is not a whole number", _OTHER_COLUMN)
