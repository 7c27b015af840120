"""Text files of PeTrack, JuPedSim and PedPy, which hold heads filmed in a laboratory, as a `Scene`.

    # framerate: 16
    # id frame x/m y/m z/m
    1 53 3.7253 -0.837 1.73

Lines above the rows that begin with `#` are comments. Lengths are metres unless a comment names another
unit, as in `x/cm`, `x [mm]` or `in cm`. Columns after the fourth are not used.
`pedpred.reading.geometry.xml` reads the geometry that comes with the text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pedpred.errors import InputError
from pedpred.files import check_input, translate_errors
from pedpred.reading import table
from pedpred.reading.errors import add_path
from pedpred.reading.geometry import occupancy_of, read_walls
from pedpred.reading.options import FASTEST_HZ, SLOWEST_HZ, ReadOptions
from pedpred.reading.tracks import to_tracks
from pedpred.scenes import Scene, Trajectories
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
    path = folder / f"{how.recording}.txt"
    walls = read_walls(path.with_suffix(".xml"))
    with translate_errors(partial(InputError, path.with_suffix(".xml"), None)):
        occupancy = occupancy_of(walls, how.resolution_m, how.thickness_m, how.open_ends, how.open_end_m)
    trajectories = read_tracks(path, how.frame_rate_hz)
    with add_path(path):
        return Scene(name, trajectories, occupancy, trajectories.usual_interval_s())


def read_tracks(path: Path, rate_hz: float | None = None) -> Trajectories:
    """Read the text alone.

    Args:
        path: the file.
        rate_hz: frames per second, needed if no comment has it.

    Raises:
        InputError: the file is missing or wrong; it names line and value.
    """
    options = ReadOptions(columns=COLUMNS, rate_hz=rate_hz)
    check_input(path)
    with add_path(path):
        return to_tracks(str(path), table.read(path, options), options).people
