"""Text files of the ETH/UCY comparison (Gupta et al., CVPR 2018) as a `Scene`.

    0.0 1.0 13.45 3.94

Each row is one person in one annotated frame: `frame id x y`, in metres. Nothing says where obstacles are, so
that the map is free. The positions of UCY (Lerner et al. 2007) are splines through few control points: they
are smooth, and just before a control point they depend on where the person goes next.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pedpred.reading import read_recording
from pedpred.reading.errors import add_path
from pedpred.reading.options import ReadOptions
from pedpred.scenes import Scene
from pedpred.settings import load
from pedpred.sources.ewap import EwapSettings, free_ground

COLUMNS = ("frame", "id", "x", "y")


@dataclass(frozen=True)
class EthUcySettings(EwapSettings):
    """What the files do not say.

    Attributes:
        recording: name of the file.
    """

    recording: str


def read_text(folder: Path, name: str, settings: Mapping[str, Any]) -> Scene:
    """Read one file.

    Args:
        folder: holds <recording>.txt.
        name: name of the scene.
        settings: the fields of `EthUcySettings`.

    Raises:
        InputError: the file is missing or wrong; it names line and value.
        ValueRuleError: a setting is out of range.
    """
    how: EthUcySettings = load(EthUcySettings, settings)
    path = folder / f"{how.recording}.txt"
    options = ReadOptions(columns=COLUMNS, rate_hz=how.frame_rate_hz, any_speed=True)
    people = read_recording(path, options).scene.trajectories
    with add_path(path):
        ground = free_ground(people.position, how.resolution_m, how.margin_m)
    return Scene(name, people, ground, how.annotation_frames / how.frame_rate_hz)
