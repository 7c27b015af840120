"""Text files of the ETH/UCY comparison (Gupta et al., CVPR 2018) as a `Scene`.

    0.0 1.0 13.45 3.94

Each row is one person in one annotated frame: `frame id x y`, in metres. Nothing says where obstacles are, so
that the map is free. The positions of UCY (Lerner et al. 2007) are splines through few control points: they
are smooth, and just before a control point they depend on where the person goes next.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pedpred.errors import InputError
from pedpred.files import translate_errors
from pedpred.scenes import Scene, Trajectories
from pedpred.settings import load
from pedpred.sources.ewap import EwapSettings, free_ground, read_annotations

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
    rows = read_annotations(path, COLUMNS, ("x", "y"))
    with translate_errors(partial(InputError, path, None)):
        trajectories = Trajectories(rows.frame / how.frame_rate_hz, rows.track_id, rows.position)
        ground = free_ground(rows.position, how.resolution_m, how.margin_m)
    return Scene(name, trajectories, ground, how.annotation_frames / how.frame_rate_hz)
