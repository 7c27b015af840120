"""The table of metrics. A new one is a function here and a line in `METRICS`.

Each function gives one value per window, NaN where the metric does not apply; means over windows, intervals
and paired differences follow from these (`pedpred.evaluation.summary`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from pedpred.errors import shape_error
from pedpred.metrics.calibration import FINE, mixture_nll
from pedpred.metrics.energy import energy_scores
from pedpred.metrics.paths import displacement, too_close
from pedpred.scenes import OccupancyMap, Predictions


@dataclass(frozen=True)
class MetricScene:
    """What metrics know of a scene besides predictions and truth. W windows.

    Attributes:
        occupancy: static obstacles.
        time_s: instant of each window, s. [W]
        speed_mps: of each person at that instant. [W]
        moving_mps: slower people count as standing.
        collision_m: people forecast nearer than this at the same step collide.
        miss_m: a forecast whose last position is farther off than this is a miss.
    """

    occupancy: OccupancyMap
    time_s: np.ndarray
    speed_mps: np.ndarray
    moving_mps: float
    collision_m: float
    miss_m: float = 2.0

    def __post_init__(self) -> None:
        if self.time_s.shape != self.speed_mps.shape:
            raise shape_error("speed_mps", self.speed_mps.shape, str(self.time_s.shape))

    @property
    def moving(self) -> np.ndarray:
        """Whether each person moves. [W] bool."""
        return self.speed_mps > self.moving_mps


MetricFunction = Callable[[Predictions, np.ndarray, MetricScene], np.ndarray]
"""(predictions [W], true paths [W, P, 2] in the world frame, scene) -> values [W]"""


@dataclass(frozen=True)
class Metric:
    """One row of the table.

    Attributes:
        label: name in reports.
        unit: "m", "%" (values are shares of 1) or "nats".
        better: which direction is better.
        value: gives one value per window.
    """

    label: str
    unit: str
    better: Literal["lower", "higher"]
    value: MetricFunction


def ade(predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """Average displacement error: mean distance over the steps, m."""
    return displacement(predictions.point, truth).mean(axis=1)


def fde(predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """Final displacement error: distance at the last step, m."""
    return displacement(predictions.point, truth)[:, -1]


def ade_of(moving: bool, predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """ADE of the moving or of the standing people, m."""
    return np.where(scene.moving == moving, ade(predictions, truth, scene), np.nan)


def stopping_ade(predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """ADE of people who walk now, faster than twice `moving_mps`, and stand at the end of the horizon, m."""
    stops = (scene.speed_mps > 2 * scene.moving_mps) & (_end_mps(predictions, truth) <= scene.moving_mps)
    return np.where(stops, ade(predictions, truth, scene), np.nan)


def starting_ade(predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """ADE of people who stand now and walk at the end, faster than twice `moving_mps`, m."""
    starts = ~scene.moving & (_end_mps(predictions, truth) > 2 * scene.moving_mps)
    return np.where(starts, ade(predictions, truth, scene), np.nan)


def _end_mps(predictions: Predictions, truth: np.ndarray) -> np.ndarray:
    """True mean speed over the last three intervals of the horizon, m/s; NaN where there is none. [W]."""
    last = truth[:, -4:]
    seconds = predictions.dt_s * (last.shape[1] - 1)
    return displacement(last[:, -1], last[:, 0]) / (seconds or np.nan)


def best_ade(k: int, predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """Least ADE among the k most likely modes, m."""
    return displacement(predictions.path[:, :k], truth[:, None]).mean(axis=2).min(axis=1)


def best_fde(k: int, predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """Least FDE among the k most likely modes, m."""
    return displacement(predictions.path[:, :k, -1], truth[:, None, -1]).min(axis=1)


def missed(k: int, predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """1 where the FDE of all k most likely modes exceeds `miss_m`, else 0."""
    return (best_fde(k, predictions, truth, scene) > scene.miss_m).astype(float)


def nll(predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """Negative log likelihood of the true positions, mean over the steps, nats (density per m^2)."""
    return mixture_nll(predictions, truth).mean(axis=1)


def energy_score(predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """Energy score of the positions, mean over the steps, m (Gneiting & Raftery 2007, sec. 4.3, beta = 1).

    ES = E|X - y| - E|X - X'| / 2 (their sign reversed), with X, X' drawn independently from the forecast
    and y the truth. The expectations run over the weighted modes; within a mode over points that stand for
    its Gaussian where it has one. ES of a single path without covariance equals its ADE.
    """
    covariance = predictions.covariance
    if covariance is None:
        covariance = np.zeros((*predictions.path.shape, 2))
    return energy_scores(predictions.path, covariance, predictions.weight, FINE.offset, truth)


def in_obstacle(predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """Share of the point forecast's positions in occupied cells."""
    return scene.occupancy.is_occupied(predictions.point).mean(axis=1)


def collides(predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """1 where the point forecast comes too close to another one of the same instant, else 0."""
    return too_close(predictions.point, scene.time_s, scene.collision_m).astype(float)


def modes_collide(predictions: Predictions, truth: np.ndarray, scene: MetricScene) -> np.ndarray:
    """`collides` of the most likely modes, where there are several."""
    if predictions.modes == 1:
        return np.full(len(predictions), np.nan)
    return too_close(predictions.most_likely, scene.time_s, scene.collision_m).astype(float)


def _best_of(key: str, label: str, unit: str, function: Callable[..., np.ndarray]) -> dict[str, Metric]:
    """A metric over the k most likely modes, for k = 1, 3 and 6."""
    return {f"{key}_k{k}": Metric(label.format(k=k), unit, "lower", partial(function, k)) for k in (1, 3, 6)}


METRICS: dict[str, Metric] = {
    "ade_m": Metric("ADE", "m", "lower", ade),
    "fde_m": Metric("FDE", "m", "lower", fde),
    "moving_ade_m": Metric("ADE moving", "m", "lower", partial(ade_of, True)),
    "standing_ade_m": Metric("ADE standing", "m", "lower", partial(ade_of, False)),
    "stopping_ade_m": Metric("ADE stopping", "m", "lower", stopping_ade),
    "starting_ade_m": Metric("ADE starting", "m", "lower", starting_ade),
    "most_likely_ade_m": Metric("ADE most likely mode", "m", "lower", partial(best_ade, 1)),
    **_best_of("min_ade_m", "minADE{k}", "m", best_ade),
    **_best_of("min_fde_m", "minFDE{k}", "m", best_fde),
    **_best_of("miss_rate", "miss rate {k}", "%", missed),
    "nll": Metric("NLL", "nats", "lower", nll),
    "energy_score_m": Metric("energy score", "m", "lower", energy_score),
    "obstacle_share": Metric("in obstacles", "%", "lower", in_obstacle),
    "collision_share": Metric("collisions", "%", "lower", collides),
    "mode_collision_share": Metric("collisions of most likely modes", "%", "lower", modes_collide),
}
"""Key in metric files -> metric."""
