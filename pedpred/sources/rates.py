"""Frame rates, from files or options."""

from __future__ import annotations

from pathlib import Path

from pedpred.errors import SourceError
from pedpred.tables.options import FASTEST_HZ, SLOWEST_HZ, TableOptions, is_same_rate


def check_rate(path: Path, line: int | None, name: str, rate_hz: float) -> float:
    """Return the rate that a file says under some name.

    Raises:
        SourceError: it is not a rate.
    """
    if not SLOWEST_HZ <= rate_hz <= FASTEST_HZ:
        raise SourceError(path, line, f"{name} = {rate_hz:g} is not a rate")
    return rate_hz


def agreed_rate(
    path: Path,
    said: float | None,
    options: TableOptions,
    missing: str,
    name: str = "fps",
    line: int | None = None,
) -> float:
    """Return the rate that a file says, or else the options.

    Args:
        path: of the file.
        said: by the file; None: nothing.
        options: what the user says.
        missing: what is wrong if nobody says it.
        name: under which the file says it.
        line: where it does.

    Raises:
        SourceError: nobody says it, both do and differ, or it is not a rate.
    """
    if said is None:
        if options.rate_hz is None:
            raise SourceError(path, None, missing, "Say how many frames a second has: --rate")
        return options.rate_hz
    if options.rate_hz is not None and not is_same_rate(options.rate_hz, said):
        problem = f"{name} = {said:g}, but --rate says {options.rate_hz:g}"
        raise SourceError(path, line, problem, "Leave --rate out")
    return check_rate(path, line, name, said)
