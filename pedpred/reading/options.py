"""Options for what a file of tracks does not contain."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pedpred.errors import ValueRuleError
from pedpred.geometry import Homography
from pedpred.settings import In, OneOf, Settings, check_choice

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "inch": 0.0254}
"""Metres per unit of length."""
PIXELS = "px"
QUANTITIES = ("time", "frame", "id", "x", "y", "class")
"""What columns may hold."""
SLOWEST_HZ, FASTEST_HZ = 1e-3, 1e6
_SAME_RATE = 1e-5  # rates such as 29.97 and 30000/1001 are one


@dataclass(frozen=True)
class ReadOptions(Settings):
    """Options for what a file of tracks does not contain; None or empty: it does, or it is not needed.

    Attributes:
        columns: quantity -> title, or the quantities in the order of the columns; other words are ignored.
        rate_hz: frames per second.
        unit: of lengths, a key of `UNITS`.
        pixel_m: side of a pixel, m, where positions are pixels of a camera that looks straight down.
        homography: pixels to the ground, m, in place of `pixel_m`.
        classes: which classes are people; `("",)`: all.
        delimiter: between the fields of a text, one character; a blank stands for any number of blanks.
        decimal: the decimal mark of numbers in a text.
        encoding: of a text, as Python calls it.
        any_speed: read people who are faster than people walk, with a warning.
        one_person_per_file: the path is a folder; the name of each file in it is the id of a person.
    """

    columns: Mapping[str, str] | tuple[str, ...] | None = None
    rate_hz: Annotated[float, In(f"[{SLOWEST_HZ}, {FASTEST_HZ}]")] | None = None
    unit: Annotated[str, OneOf(tuple(UNITS))] | None = None
    pixel_m: Annotated[float, In("(0, 10]")] | None = None
    homography: Homography | None = None
    classes: tuple[str, ...] = ()
    delimiter: str | None = None
    decimal: Annotated[str, OneOf((".", ","))] = "."
    encoding: str | None = None
    any_speed: bool = False
    one_person_per_file: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_columns()
        if sum(value is not None for value in (self.unit, self.pixel_m, self.homography)) > 1:
            field = "unit" if self.unit is not None else "pixel_m"
            rule = "unit, size of a pixel and homography exclude each other: give one"
            raise ValueRuleError(field, getattr(self, field), rule)
        if self.delimiter is not None and (len(self.delimiter) != 1 or self.delimiter in '"\r\n'):
            raise ValueRuleError("delimiter", self.delimiter, "it must be one character, such as ;")
        if self.decimal == "," == self.delimiter:
            raise ValueRuleError("decimal", ",", "it cannot be the delimiter, too")

    def _check_columns(self) -> None:
        names = list(self.columns or ())
        if isinstance(self.columns, Mapping):
            for name in names:
                check_choice("columns", name, QUANTITIES)
        elif self.columns is not None:
            needed = ["x", "y"] if self.one_person_per_file else ["id", "x", "y"]
            clocks = names.count("time") + names.count("frame")
            if any(names.count(name) != 1 for name in needed) or clocks != 1:
                rule = "name all columns in order, each of id, x, y and time or frame once: frame,id,x,y"
                raise ValueRuleError("columns", ",".join(names), rule)

    @property
    def lengths(self) -> str | None:
        """The unit of lengths in the options, or `PIXELS`."""
        return self.unit if self.pixel_m is None and self.homography is None else PIXELS


def is_same_rate(one_hz: float, other_hz: float) -> bool:
    """Whether two rates are one, written with more or fewer digits."""
    return math.isclose(one_hz, other_hz, rel_tol=_SAME_RATE)
