"""Names of tracks in files with words as ids; in memory, tracks have numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

_WHOLE = re.compile(r"-?[0-9]{1,19}")


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
