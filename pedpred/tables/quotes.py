"""Line ends inside quotes, as in notes of spreadsheets: the field goes on in the next line."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator

Numbered = tuple[int, str]
"""Line number (from 1) and content of a line."""

_SEPARATED = re.compile(r"[;\t|,]")
_BEFORE = {True: r"(?:^|[;\t|,])\s*", False: r"(?:^|\s)"}
_AFTER = {True: r"\s*(?:$|[;\t|,])", False: r"(?:$|\s)"}
_WHOLE = {s: re.compile(rf'({_BEFORE[s]})"(?:[^"]|"")*"(?={_AFTER[s]})') for s in (True, False)}
_OPENING = {signs: re.compile(rf'{before}"') for signs, before in _BEFORE.items()}
"""Quotes hold a field together where they begin and end it; by whether other signs than blanks separate."""
_CLOSING = re.compile(r'"(?:$|[\s;|,])')
"""What a line has in which a quote of an earlier one is closed."""
_MOST_LINES = 100
"""A quote that is not closed within so many is none."""


def joined(
    lines: Iterable[Numbered], is_comment: Callable[[str], bool] = lambda text: False
) -> Iterator[Numbered]:
    """The lines of a table, with a blank in place of each line end inside quotes.

    Args:
        lines: as they stand in a file.
        is_comment: whether a line is one, in which quotes mean nothing.
    """
    rest, ahead = iter(lines), deque[Numbered]()
    while (first := ahead.popleft() if ahead else next(rest, None)) is not None:
        line, text = first
        if '"' in text and _ends_inside(text) and not is_comment(text):
            parts = [text]
            for count in range(1, _MOST_LINES + 1):
                if count > len(ahead) and (following := next(rest, None)) is not None:
                    ahead.append(following)
                if count > len(ahead):
                    break
                parts[-1] = parts[-1].rstrip()
                parts.append(ahead[count - 1][1])
                if _CLOSING.search(parts[-1]) and not _ends_inside(" ".join(parts)):
                    for _ in range(count):
                        ahead.popleft()
                    first = line, " ".join(parts)
                    break
        yield first


def _ends_inside(text: str) -> bool:
    signs = bool(_SEPARATED.search(text))
    return bool(_OPENING[signs].search(_WHOLE[signs].sub(r"\1_", text)))
