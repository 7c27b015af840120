"""The answer of every forecaster: one path per person, and the weighted paths it may take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from pedpred.arrays import real_number, real_numbers
from pedpred.compiled import compiled
from pedpred.errors import ValueRuleError, shape_error
from pedpred.geometry import placed, rotated_covariance

Frame = Literal["world", "agent"]
_SUM_TOLERANCE = 1e-4


@dataclass(frozen=True)
class Predictions:
    """Where W people are forecast to be at P steps, each from its own present. K modes.

    Attributes:
        point: the one path that the method would give; errors are measured on it, m. [W, P, 2]
        path: the modes, most likely first, m. [W, K, P, 2]
        weight: probability of each mode, not rising; each row sums to 1. [W, K]
        dt_s: time between two steps, s; step p lies (p + 1) dt_s after the present.
        covariance: of the positions, within each mode, m^2; None from a method that gives none.
            [W, K, P, 2, 2]
        frame: "world", or "agent": origin at the person, x along its heading.

    Raises:
        ValueRuleError: the shapes do not belong together.
        ValueRuleError: weights are negative, rise or do not sum to 1; or dt_s is not positive.
    """

    point: np.ndarray
    path: np.ndarray
    weight: np.ndarray
    dt_s: float
    covariance: np.ndarray | None = None
    frame: Frame = "world"

    def __post_init__(self) -> None:
        for name in ("point", "path", "weight", "covariance"):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, real_numbers(name, value))
        if self.point.ndim != 3 or self.point.shape[2] != 2:
            raise shape_error("point", self.point.shape, "[W, P, 2]")
        rows, steps = self.point.shape[:2]
        modes = self.weight.shape[-1]
        expected = {"path": (rows, modes, steps, 2), "weight": (rows, modes)}
        if self.covariance is not None:
            expected["covariance"] = (rows, modes, steps, 2, 2)
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                raise shape_error(name, getattr(self, name).shape, str(shape))
        object.__setattr__(self, "dt_s", real_number("dt_s", self.dt_s))
        if not 0 < self.dt_s < np.inf:
            raise ValueRuleError("dt_s", self.dt_s, "it must be positive")
        if not _fall_and_sum_to_1(np.ascontiguousarray(self.weight, np.float64)):
            raise ValueRuleError("weight", "", "weights must fall and sum to 1 in each row")

    @classmethod
    def single(
        cls, point: np.ndarray, dt_s: float, covariance: np.ndarray | None = None, frame: Frame = "world"
    ) -> Predictions:
        """One mode, the point forecast itself, with the covariance of its positions [W, P, 2, 2]."""
        covariances = None if covariance is None else covariance[:, None]
        return cls(point, point[:, None], np.ones((len(point), 1)), dt_s, covariances, frame)

    @classmethod
    def join(cls, parts: Sequence[Predictions]) -> Predictions:
        """Join the rows of at least one part; all have the same modes, steps and frame.

        Raises:
            ValueRuleError: some parts have covariances, others have none.
        """
        arrays = [part.arrays() for part in parts]
        if any(columns.keys() != arrays[0].keys() for columns in arrays):
            raise shape_error("covariance", (), "all parts or none to have it")
        joined: dict[str, Any] = {n: np.concatenate([columns[n] for columns in arrays]) for n in arrays[0]}
        return replace(parts[0], **joined)

    def __len__(self) -> int:
        return len(self.point)

    @property
    def modes(self) -> int:
        """Number of modes K."""
        return self.weight.shape[1]

    @property
    def steps(self) -> int:
        """Number of steps P."""
        return self.point.shape[1]

    @property
    def most_likely(self) -> np.ndarray:
        """The path of the mode with the largest weight, m. [W, P, 2]."""
        return self.path[:, 0]

    @property
    def mean(self) -> np.ndarray:
        """The weighted mean of the modes, m. [W, P, 2]."""
        return (self.weight[:, :, None, None] * self.path).sum(axis=1)

    def sample(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Paths drawn from the modes, with their covariances where there are any, m. [W, S, P, 2].

        Steps of one path share their draw: a person who is ahead of a mode stays ahead of it.
        """
        upto = np.cumsum(self.weight, axis=1)
        drawn = rng.random((len(self), count, 1)) * upto[:, None, -1:]
        mode = np.minimum((drawn >= upto[:, None]).sum(axis=-1), self.modes - 1)
        rows = np.arange(len(self))[:, None]
        paths = self.path[rows, mode]
        if self.covariance is None:
            return paths
        scale = np.linalg.cholesky(self.covariance)[rows, mode]
        noise = rng.standard_normal((len(self), count, 1, 2, 1))
        return paths + (scale @ noise)[..., 0]

    def select(self, rows: np.ndarray) -> Predictions:
        """The predictions of some people (mask or indices)."""
        return replace(self, **{name: values[rows] for name, values in self.arrays().items()})

    def arrays(self) -> dict[str, Any]:
        """The fields that are arrays, by name; all have a row per person."""
        return {name: values for name, values in vars(self).items() if isinstance(values, np.ndarray)}

    def in_world(self, position: np.ndarray, heading_rad: np.ndarray) -> Predictions:
        """Predictions in agent frames, as seen from the world.

        Args:
            position: the agents' origins, world frame, m. [W, 2]
            heading_rad: direction of the agents' x axes, counter-clockwise from world x. [W]
        """
        if self.frame != "agent":
            raise ValueRuleError("frame", self.frame, "it must be 'agent'")
        covariance = self.covariance
        return replace(
            self,
            point=placed(self.point, position, heading_rad),
            path=placed(self.path, position, heading_rad),
            covariance=None if covariance is None else rotated_covariance(covariance, heading_rad),
            frame="world",
        )


@dataclass(frozen=True)
class Forecast:
    """Predicted paths of everybody present at one instant, by track.

    Attributes:
        time_s: the instant, s; step p of the predictions is at time_s + (p + 1) dt_s.
        track_id: [N] int64, rising
        velocity: of the point forecast, world frame, m/s. [N, P, 2]
        predictions: world frame. N rows, P steps
    """

    time_s: float
    track_id: np.ndarray
    velocity: np.ndarray
    predictions: Predictions

    def __post_init__(self) -> None:
        for name in ("track_id", "velocity"):
            object.__setattr__(self, name, real_numbers(name, getattr(self, name)))
        shape = (len(self.track_id), self.predictions.steps, 2)
        for name, values in (("predictions", self.position), ("velocity", self.velocity)):
            if values.shape != shape:
                raise shape_error(name, values.shape, str(shape))

    def __len__(self) -> int:
        return len(self.track_id)

    def locked(self) -> Forecast:
        """Make its arrays read-only, so that it can be given to several users; itself."""
        for values in (self.track_id, self.velocity, *self.predictions.arrays().values()):
            values.flags.writeable = False
        return self

    @property
    def dt_s(self) -> float:
        """Time between two steps, s."""
        return self.predictions.dt_s

    @property
    def position(self) -> np.ndarray:
        """The point forecast, world frame, m. [N, P, 2]."""
        return self.predictions.point

    @property
    def covariance(self) -> np.ndarray | None:
        """Of the positions of the most likely mode, world frame, m^2. [N, P, 2, 2]."""
        covariance = self.predictions.covariance
        return None if covariance is None else covariance[:, 0]


@compiled
def _fall_and_sum_to_1(weight: np.ndarray) -> bool:  # pragma: no cover (compiled)
    """Whether the weights in each row are no less than 0, do not rise and sum to 1. [W, K] -> bool."""
    for row in range(len(weight)):
        before, total = np.inf, 0.0
        for share in weight[row]:
            if not 0.0 <= share <= before:
                return False
            before, total = share, total + share
        if not abs(total - 1.0) <= _SUM_TOLERANCE:
            return False
    return True
