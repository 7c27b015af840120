"""Fractions of seconds without their first zeros, as where seconds and nanoseconds were joined by a point."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError

_STAMP = re.compile(r"\s*-?\d+[.,](\d{1,18})\s*")
_FEWEST = 3
"""So many times must go back."""


def check_fractions(
    path: Path, columns: Mapping[str, np.ndarray], written: Iterable[tuple[int, str]]
) -> None:
    """Check that times do not go back only because 0.050 is written as 0.50.

    Args:
        path: the file, for errors.
        columns: `time_s`, `track_id` and `line`, in the order of the lines. [M] each
        written: lines and their times as the file has them; looked at only where times go back.

    Raises:
        SourceError: within a second, times of a person go back, always to a fraction that would be a larger
            whole number.
    """
    time_s, track_id, line = (columns[name] for name in ("time_s", "track_id", "line"))
    order = np.argsort(track_id, kind="stable")
    same = (np.diff(track_id[order]) == 0) & (np.diff(np.floor(time_s[order])) == 0)
    back = np.flatnonzero(same & (np.diff(time_s[order]) < 0))
    if len(back) < _FEWEST:
        return
    pairs = list(zip(line[order[back]].tolist(), line[order[back + 1]].tolist(), strict=True))
    asked = {one for pair in pairs for one in pair}
    texts = {number: text.strip() for number, text in written if number in asked}
    found = {number: _STAMP.fullmatch(text) for number, text in texts.items()}
    digits = {number: match[1] for number, match in found.items() if match}
    if all(
        before in digits and after in digits and int(digits[before]) < int(digits[after])
        for before, after in pairs
    ):
        before, after = pairs[0]
        problem = f"the time goes back from {texts[before]} to {texts[after]}, and {len(pairs)} times in all"
        padded = texts[before][: -len(digits[before])] + digits[before].rjust(len(digits[after]), "0")
        remedy = f"Write all digits, such as {padded} in place of {texts[before]}"
        cause = "fractions look as if zeros were left out at their beginning"
        raise SourceError(path, after, f"{problem}: {cause}", remedy)
