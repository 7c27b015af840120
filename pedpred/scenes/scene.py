"""A place: its obstacles and the trajectories recorded there."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from pedpred.errors import ShapeError, ValueRuleError
from pedpred.geometry import Homography

_LARGEST_WHOLE = 2.0**63


@dataclass(frozen=True)
class Trajectories:
    """Detections sorted by (time, track). One row is one pedestrian at one instant.

    Attributes:
        time_s: time stamps, s. [M]
        track_id: of the detected pedestrian. [M]
        position: world frame, m. [M, 2]
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
        wide = {"position", "velocity", "goal"}
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None:
                continue
            whole = field.name in {"track_id", "group_id", "person_id"}
            given = np.asarray(value)
            shape = (rows, 2) if field.name in wide else (rows,)
            if given.shape != shape:
                raise ShapeError(field.name, given.shape, str(shape))
            valid = np.isfinite(given)
            if whole:
                valid &= (given == np.floor(given)) & (given >= -_LARGEST_WHOLE) & (given < _LARGEST_WHOLE)
            if not valid.all():
                row = int(np.argwhere(~valid)[0, 0])
                rule = "it must be a whole number" if whole else "it must be finite"
                raise ValueRuleError(f"{field.name}[{row}]", given[row].tolist(), rule)
            value = given.astype(np.int64 if whole else np.float64)
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
            found = f"track {self.track_id[row]} at {self.time_s[row]} s"
            raise ValueRuleError("(track_id, time_s)", found, "it must be unique")

    def __len__(self) -> int:
        return len(self.time_s)

    def usual_interval_s(self) -> float:
        """Median time between two detections of a track, s.

        Raises:
            ValueRuleError: no pedestrian was detected twice.
        """
        order = np.lexsort((self.time_s, self.track_id))
        same = np.diff(self.track_id[order]) == 0
        if not same.any():
            raise ValueRuleError("track_id", len(self), "no pedestrian was detected twice")
        return float(np.median(np.diff(self.time_s[order])[same]))

    def select(self, rows: np.ndarray) -> Trajectories:
        """Select some rows (mask or indices)."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return Trajectories(**{name: value[rows] for name, value in values.items() if value is not None})


_FREE_CELL_M = 0.1
"""Least side of a cell of a map without obstacles."""

_FREE_CELLS = 1000
"""Largest number of cells per side of such a map, so that one stray position does not need gigabytes."""


@dataclass(frozen=True)
class OccupancyMap:
    """Which cells of the ground are blocked. The ground outside the map is free.

    Attributes:
        occupied: cell (i, j) spans origin + resolution * [i, i+1) x [j, j+1). [X, Y] bool
        origin: outer corner of cell (0, 0), world frame, m. [2]
        resolution_m: side of a cell, m.
    """

    occupied: np.ndarray
    origin: np.ndarray
    resolution_m: float

    def __post_init__(self) -> None:
        occupied = np.ascontiguousarray(self.occupied, dtype=bool)
        origin = np.asarray(self.origin, dtype=np.float64)
        if occupied.ndim != 2 or occupied.size == 0:
            raise ShapeError("occupied", occupied.shape, "[X, Y], not empty")
        if origin.shape != (2,):
            raise ShapeError("origin", origin.shape, "(2,)")
        if not np.isfinite(origin).all():
            raise ValueRuleError("origin", origin.tolist(), "it must be finite")
        if not 0 < self.resolution_m < np.inf:
            raise ValueRuleError("resolution_m", self.resolution_m, "it must be positive")
        object.__setattr__(self, "occupied", occupied)
        object.__setattr__(self, "origin", origin)

    @classmethod
    def free_around(cls, points: np.ndarray, margin_m: float = 1.0) -> OccupancyMap:
        """Make a map without obstacles, for a place with unknown ones.

        Args:
            points: the map contains these, world frame, m. [M, 2]
            margin_m: ground around them, m.
        """
        ends = points if len(points) else np.zeros((1, 2))
        low, high = ends.min(axis=0) - margin_m, ends.max(axis=0) + margin_m
        resolution_m = max(_FREE_CELL_M, float((high - low).max()) / _FREE_CELLS)
        shape = np.ceil((high - low) / resolution_m).astype(np.int64)
        return cls(np.zeros(shape, bool), low, resolution_m)

    @property
    def extent_m(self) -> np.ndarray:
        """Size along x and y, m, [2]."""
        return np.array(self.occupied.shape) * self.resolution_m

    def cell_of(self, points: np.ndarray) -> np.ndarray:
        """Indices (i, j) of the cells that hold world points; may lie outside, [..., 2] int."""
        relative = (np.asarray(points, dtype=np.float64) - self.origin) / self.resolution_m
        return np.floor(relative).astype(np.int64)

    def center_of(self, cells: np.ndarray) -> np.ndarray:
        """World positions of cell centres, m, [..., 2]."""
        return self.origin + (np.asarray(cells) + 0.5) * self.resolution_m

    def is_occupied(self, points: np.ndarray) -> np.ndarray:
        """Whether world points (m, [..., 2]) lie in an occupied cell; outside is free. Bool, [...]."""
        cells = self.cell_of(points)
        inside = np.asarray(((cells >= 0) & (cells < self.occupied.shape)).all(axis=-1))
        cells = np.where(inside[..., None], cells, 0)
        return inside & self.occupied[cells[..., 0], cells[..., 1]]


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
        unavailable: where the recording could not be had: who says why. Such a scene has no detections.
    """

    name: str
    trajectories: Trajectories
    occupancy: OccupancyMap
    detection_dt_s: float
    camera: Camera | None = None
    unavailable: str | None = None

    def __post_init__(self) -> None:
        if not self.name.isprintable() or self.name in ("", ".", "..") or "/" in self.name:
            raise ValueRuleError("name", self.name, "it must be a valid folder name")
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
