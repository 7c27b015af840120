"""The detections of one instant, checked before anything depends on them."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.arrays import real_number, real_numbers
from pedpred.errors import ValueRuleError, brief, shape_error
from pedpred.scenes import rule_of
from pedpred.tracking.tracks import FASTEST_MPS

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Frame:
    """Copies of the arguments of `OnlinePredictor.update`.

    Attributes:
        time_s: of the frame, s.
        track_id: rising. [D] int64
        position: world frame, m. [D, 2]
        velocity: true velocities, or None. [D, 2] m/s
    """

    time_s: float
    track_id: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None

    def __len__(self) -> int:
        return len(self.track_id)

    def select(self, rows: np.ndarray) -> Frame:
        """Some of the detections (mask)."""
        velocity = None if self.velocity is None else self.velocity[rows]
        return Frame(self.time_s, self.track_id[rows], self.position[rows], velocity)

    @classmethod
    def checked(cls, time_s: Any, track_id: Any, position: Any, velocity: Any = None) -> Frame:
        """Convert and sort the arguments; the ranges are those of `Trajectories`.

        Velocities that nobody can have are shortened, with a warning: they would spoil the forecasts of
        everybody near.

        Raises:
            ValueRuleError: something is not a number or out of range, or an id appears twice.
        """
        now, names = real_number("time_s", time_s), real_numbers("track_id", track_id)
        _check("time_s", np.asarray(now))
        if names.ndim != 1 or (len(names) and names.dtype.kind not in "iu"):
            raise ValueRuleError("track_id", names.tolist(), "it must be a list of whole numbers of 64 bits")
        _check("track_id", names)
        order = np.argsort(names)
        names = names[order]
        again = names[1:] == names[:-1]
        if again.any():
            raise ValueRuleError("track_id", int(names[1:][again][0]), "it must appear once in a frame")
        names = names.astype(np.int64)
        where = _pairs("position", position, len(names))[order]
        if velocity is not None:
            velocity = _shortened(_pairs("velocity", velocity, len(names))[order], names, now)
        return cls(now, names, where, velocity)


def _pairs(name: str, value: Any, rows: int) -> np.ndarray:
    """Numbers, [rows, 2]; an empty frame may come in any shape."""
    pairs = real_numbers(name, value).astype(np.float64)
    pairs = pairs.reshape(0, 2) if not pairs.size else pairs
    if pairs.shape != (rows, 2):
        raise shape_error(name, pairs.shape, f"({rows}, 2)")
    _check(name, pairs)
    return pairs


def _shortened(velocity: np.ndarray, track_id: np.ndarray, time_s: float) -> np.ndarray:
    """Velocities of which none is faster than somebody can be, m/s. [D, 2]."""
    speed = np.hypot(*velocity.T)
    fast = speed > FASTEST_MPS
    if fast.any():
        text = "velocities at %s s of more than %g m/s are shortened to it: tracks %s"
        _LOG.warning(text, time_s, FASTEST_MPS, brief(track_id[fast].tolist()))
        velocity = velocity * (FASTEST_MPS / np.maximum(speed, FASTEST_MPS))[:, None]
    return velocity


def _check(name: str, values: np.ndarray) -> None:
    rule, valid = rule_of(name, values)
    if not valid.all():
        row = np.argwhere(~valid)[0, :1].tolist()
        raise ValueRuleError(f"{name}{row or ''}", values[tuple(row)].tolist(), rule)
