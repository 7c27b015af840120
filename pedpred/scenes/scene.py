"""A place: its obstacles and the trajectories recorded there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.errors import ShapeError, ValueRuleError
from pedpred.geometry import Homography
from pedpred.scenes.occupancy import OccupancyMap
from pedpred.scenes.trajectories import Trajectories


@dataclass(frozen=True)
class Camera:
    """A still picture of the place and the homography to the ground.

    Attributes:
        homography: image (row, column) <-> world.
        picture: [rows, columns, 3] uint8
    """

    homography: Homography
    picture: np.ndarray

    def __post_init__(self) -> None:
        if self.picture.ndim != 3 or self.picture.shape[2] != 3:
            raise ShapeError("picture", self.picture.shape, "[rows, columns, 3]")


@dataclass(frozen=True)
class Scene:
    """Trajectories and obstacles of one place.

    Attributes:
        name: short identifier, also its folder's name.
        trajectories: detections of all pedestrians.
        occupancy: the static obstacles.
        detection_dt_s: usual time between two detections of a track, s.
        camera: optional view of the place.
    """

    name: str
    trajectories: Trajectories
    occupancy: OccupancyMap
    detection_dt_s: float
    camera: Camera | None = None

    def __post_init__(self) -> None:
        if not self.name.isprintable() or self.name in ("", ".", "..") or "/" in self.name:
            raise ValueRuleError("name", self.name, "it must be a valid folder name")
        if not 0 < self.detection_dt_s < np.inf:
            raise ValueRuleError("detection_dt_s", self.detection_dt_s, "it must be positive")
