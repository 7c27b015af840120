"""A place: the trajectories recorded there, its obstacles and a view of it."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from pedpred.arrays import real_number, real_numbers
from pedpred.errors import ValueRuleError, shape_error
from pedpred.geometry import Homography
from pedpred.scenes.occupancy import FARTHEST_M, OccupancyMap

_LARGEST_WHOLE = 2**63 - 1
_WHOLE, _PAIRS = ("track_id", "group_id", "person_id"), ("position", "velocity", "goal")

LATEST_S = 2.0**32
"""Times are seconds before this (Unix times up to 2106), so that they are exact to a microsecond."""


@dataclass(frozen=True)
class Trajectories:
    """Detections sorted by (time, track). One row is one pedestrian at one instant.

    Attributes:
        time_s: time stamps, s, less than `LATEST_S` from 0. [M]
        track_id: of the detected pedestrian. [M]
        position: world frame, m, at most `FARTHEST_M` from 0. [M, 2]
        velocity: true velocity, in simulations, m/s. [M, 2]
        goal: true current goal, world frame, m. [M, 2]
        desired_speed_mps: true desired speed, m/s. [M]
        group_id: shared by pedestrians who walk together; -1: alone. [M]
        person_id: the true identity, where a simulated sensor swaps ids. [M]
    """

    time_s: np.ndarray
    track_id: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None = None
    goal: np.ndarray | None = None
    desired_speed_mps: np.ndarray | None = None
    group_id: np.ndarray | None = None
    person_id: np.ndarray | None = None

    def __post_init__(self) -> None:
        rows = len(self.time_s)
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None:
                continue
            values = real_numbers(field.name, value)
            shape = (rows, 2) if field.name in _PAIRS else (rows,)
            if values.shape != shape:
                raise shape_error(field.name, values.shape, str(shape))
            rule, valid = rule_of(field.name, values)
            if not valid.all():
                row = int(np.argwhere(~valid)[0, 0])
                raise ValueRuleError(f"{field.name}[{row}]", values[row].tolist(), rule)
            value = values.astype(np.int64 if field.name in _WHOLE else np.float64)
            object.__setattr__(self, field.name, value)
        self._sort()

    def _sort(self) -> None:
        """Sort rows by (time, track), and check that no pair occurs twice."""
        order = np.lexsort((self.track_id, self.time_s))
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None:
                object.__setattr__(self, field.name, value[order])
        same = (np.diff(self.time_s) == 0) & (np.diff(self.track_id) == 0)
        if same.any():
            row = int(np.flatnonzero(same)[0])
            detection = f"track {self.track_id[row]} at {self.time_s[row]} s"
            raise ValueRuleError("(track_id, time_s)", detection, "it must be unique")

    def __len__(self) -> int:
        return len(self.time_s)

    def by_track(self) -> list[np.ndarray]:
        """Rows of each track in the order of time; tracks by id."""
        order = np.lexsort((self.time_s, self.track_id))
        starts = np.flatnonzero(np.diff(self.track_id[order])) + 1
        return np.split(order, starts) if len(order) else []

    def usual_interval_s(self) -> float:
        """Median time between two detections of a track, s.

        Raises:
            ValueRuleError: no pedestrian was detected twice.
        """
        order = np.lexsort((self.time_s, self.track_id))
        same = np.diff(self.track_id[order]) == 0
        if not same.any():
            counts = f"{len(self)} ids in {len(self)} detections"
            rule = "no pedestrian was detected twice; ids must stay with people"
            rule = rule if len(self) else "there are no detections"
            raise ValueRuleError("track_id", counts, rule)
        return float(np.median(np.diff(self.time_s[order])[same]))

    def select(self, rows: np.ndarray) -> Trajectories:
        """Select some rows (mask or indices)."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return Trajectories(**{name: value[rows] for name, value in values.items() if value is not None})


def rule_of(field: str, values: np.ndarray) -> tuple[str, np.ndarray]:
    """The rule of a field of `Trajectories`, and which of some values obey it, each one a bool."""
    if field in _WHOLE:
        valid = values <= _LARGEST_WHOLE
        if values.dtype.kind not in "iu":
            valid &= (values >= -_LARGEST_WHOLE) & (values == np.floor(values)) & (values != _LARGEST_WHOLE)
        return "it must be a whole number of 64 bits", valid
    if field == "time_s":
        rule = f"it must be finite, in seconds, less than {LATEST_S:.0f} from 0: convert ms, us or ns to s"
        return rule, (values > -LATEST_S) & (values < LATEST_S)
    rule = f"it must be finite, at most {FARTHEST_M:g} from 0"
    return rule, (values >= -FARTHEST_M) & (values <= FARTHEST_M)


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
        object.__setattr__(self, "picture", real_numbers("picture", self.picture))
        if self.picture.ndim != 3 or self.picture.shape[2] != 3:
            raise shape_error("picture", self.picture.shape, "[rows, columns, 3]")


@dataclass(frozen=True)
class Scene:
    """Trajectories and obstacles of one place.

    Attributes:
        name: short identifier, also its folder's name.
        trajectories: detections of all pedestrians.
        occupancy: the static obstacles.
        detection_dt_s: usual time between two detections of a track, s.
        camera: optional view of the place.
        unavailable: where the recording could not be had: how to get it. Such a scene has no detections.
        stand_in: where simulated people stand in for recorded ones: how they were made.
    """

    name: str
    trajectories: Trajectories
    occupancy: OccupancyMap
    detection_dt_s: float
    camera: Camera | None = None
    unavailable: str | None = None
    stand_in: str | None = None

    def __post_init__(self) -> None:
        if not self.name.isprintable() or self.name in ("", ".", "..") or "/" in self.name:
            raise ValueRuleError("name", self.name, "it must be a valid folder name")
        object.__setattr__(self, "detection_dt_s", real_number("detection_dt_s", self.detection_dt_s))
        if not 0 < self.detection_dt_s < np.inf:
            raise ValueRuleError("detection_dt_s", self.detection_dt_s, "it must be positive")
        if self.unavailable is not None and len(self.trajectories):
            rule = "it belongs to a scene without detections"
            raise ValueRuleError("unavailable", self.unavailable, rule)

    @classmethod
    def without_people(cls, name: str, unavailable: str) -> Scene:
        """Stand in for a place whose recording is not available: nobody, on one free square metre."""
        nobody = Trajectories(np.empty(0), np.empty(0), np.empty((0, 2)))
        ground = OccupancyMap(np.zeros((1, 1), bool), np.zeros(2), 1.0)
        return cls(name, nobody, ground, 1.0, unavailable=unavailable)
