"""Time-stamped detections of all pedestrians of one place."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from pedpred.errors import ShapeError, ValueRuleError

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
