"""What a table does not say itself."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from pedpred.errors import ValueRuleError
from pedpred.fields import check_choice
from pedpred.geometry import Homography
from pedpred.tables.names import TrackNames
from pedpred.tables.titles import titles_of_tracks
from pedpred.tables.units import UNITS, FoundUnit

SLOWEST_HZ, FASTEST_HZ = 1e-3, 1e6
"""Rates of frames that a table may have."""

_LARGEST_PIXEL_M = 10.0
_SAME_RATE = 1e-5
"""Rates that differ by less than this share are one, such as 29.97 and 30000/1001."""


def is_same_rate(one_hz: float, other_hz: float) -> bool:
    """Whether two rates are one, written with more or fewer digits."""
    return math.isclose(one_hz, other_hz, rel_tol=_SAME_RATE)


@dataclass(frozen=True)
class TableOptions:
    """What a table does not say itself.

    Attributes:
        columns: their names in order, in place of a header; None: the header has them.
        rate_hz: of frame numbers; None: the file says it, or has times.
        unit: of lengths, a key of `UNITS`; None: the file says it, or they are metres.
        pixel_m: side of a pixel, m, where people were annotated in a picture.
        homography: where pixels lie on the ground, in place of `pixel_m`; None: the camera looks straight
            down.
        names: of tracks whose ids are words; the reader adds them.
        found: the unit of lengths that was read; the reader sets it.
        classes: who is a person, where a column holds classes; empty: whoever is called so.
    """

    columns: tuple[str, ...] | None = None
    rate_hz: float | None = None
    unit: str | None = None
    pixel_m: float | None = None
    homography: Homography | None = None
    names: TrackNames = field(default_factory=TrackNames, compare=False)
    classes: tuple[str, ...] = ()
    found: FoundUnit = field(default_factory=FoundUnit, compare=False)

    def __post_init__(self) -> None:
        if self.columns is not None:
            titles_of_tracks(self.columns)
        if self.rate_hz is not None and not SLOWEST_HZ <= self.rate_hz <= FASTEST_HZ:
            raise ValueRuleError("rate_hz", self.rate_hz, "it must be a number from 0.001 to 1000000 Hz")
        if self.unit is not None:
            check_choice("unit", self.unit, list(UNITS))
        if self.pixel_m is not None and not 0.0 < self.pixel_m <= _LARGEST_PIXEL_M:
            raise ValueRuleError(
                "pixel_m", self.pixel_m, f"it must be positive, at most {_LARGEST_PIXEL_M} m"
            )
        if self.pixel_m is not None and self.unit is not None:
            raise ValueRuleError("unit", self.unit, "lengths are pixels, whose size is given: omit one")
        if self.homography is not None:
            for name in ("pixel_m", "unit"):
                if (value := getattr(self, name)) is not None:
                    raise ValueRuleError(name, value, "a homography contains the size of a pixel: omit one")

    @property
    def are_pixels(self) -> bool:
        """Whether the caller says where pixels lie on the ground."""
        return self.pixel_m is not None or self.homography is not None
