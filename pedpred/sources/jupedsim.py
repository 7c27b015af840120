"""Laboratory recordings of Juelich as a `Scene`: heads as PeTrack writes them, and the geometry of the walls.

Rows of the text are `id frame x y z`; comments above them say the frame rate and the unit of lengths.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pedpred.reading import read_recording
from pedpred.reading.errors import add_path
from pedpred.reading.geometry import occupancy_of, read_walls
from pedpred.reading.options import FASTEST_HZ, SLOWEST_HZ, ReadOptions
from pedpred.scenes import Scene
from pedpred.settings import In, Settings, finite, load

COLUMNS = ("id", "frame", "x", "y")


@dataclass(frozen=True)
class LaboratorySettings(Settings):
    """What the files of a recording do not say.

    Attributes:
        recording: name of its files.
        resolution_m: see `occupancy_of`.
        thickness_m: see there.
        open_ends: see there.
        open_end_m: see there.
        frame_rate_hz: needed if the text has none.
    """

    recording: str
    resolution_m: Annotated[float, In("[0.001, 100]")]
    thickness_m: Annotated[float, In("(0, 1000]")]
    open_ends: Sequence[Sequence[Sequence[float]]] = ()
    open_end_m: Annotated[float, In("[0, 1000]")] = 0.0
    frame_rate_hz: Annotated[float, In(f"[{SLOWEST_HZ}, {FASTEST_HZ}]")] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.open_ends != ():
            finite("open_ends", self.open_ends, (None, 2, 2))


def read_laboratory(folder: Path, name: str, settings: Mapping[str, Any]) -> Scene:
    """Read one recording and its geometry.

    Args:
        folder: holds <recording>.txt and <recording>.xml.
        name: name of the scene.
        settings: the fields of `LaboratorySettings`.

    Raises:
        InputError: a file is missing or wrong; it names file, line and value.
        ValueRuleError: a setting is out of range.
    """
    how: LaboratorySettings = load(LaboratorySettings, settings)
    path, outline = folder / f"{how.recording}.txt", folder / f"{how.recording}.xml"
    walls = read_walls(outline)
    with add_path(outline):
        ground = occupancy_of(walls, how.resolution_m, how.thickness_m, how.open_ends, how.open_end_m)
    options = ReadOptions(columns=COLUMNS, rate_hz=how.frame_rate_hz, any_speed=True)
    return replace(read_recording(path, options).scene, name=name, occupancy=ground)
