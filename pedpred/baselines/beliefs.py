"""Beliefs about the goals and desired speeds of pedestrians, from their motion so far.

A recursive Bayesian filter of the social-force model itself. Between two observations the model is
linear in the velocity v and in the desired speed v0 (Helbing & Molnar 1995, eq. 2 and 9, integrated over
an interval T with the desired direction e and all other forces f at their mean):

    v(t + T) = a v(t) + (1 - a) (v0 e_g + tau f_g) + noise,   a = exp(-T / tau)

Under each goal g the desired speed is thus a Gaussian that is updated like the state of a Kalman filter, and
the density of the observed velocity is the likelihood of g. A goal that is reached is replaced by one
that may follow it. The belief at t uses nothing later than t.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.baselines.influences import Influences, Observations, influences_between
from pedpred.baselines.together import instants
from pedpred.baselines.walking import Walking
from pedpred.errors import ShapeError
from pedpred.simulation.ground import Ground
from pedpred.simulation.routing import Routes

_ARRIVING_MPS = 0.3  # deviation of the velocity after an interval in which the goal changes
_BLUR_M = 0.05  # paths between observations are known this well
_SURPRISE = 1e-3  # share of velocities that the model does not explain ...
_SURPRISE_MPS = 0.5  # ... and how far off they are
_LEAST_VARIANCE = 1e-9


@dataclass(frozen=True)
class GoalBelief:
    """Posterior over goals and, under each goal, over the desired speed.

    Attributes:
        probability: of each goal. [M, G]
        speed_mps: mean of the desired speed. [M, G]
        variance: of the desired speed, m^2/s^2. [M, G]
    """

    probability: np.ndarray
    speed_mps: np.ndarray
    variance: np.ndarray

    def __post_init__(self) -> None:
        for name in ("speed_mps", "variance"):
            if getattr(self, name).shape != self.probability.shape:
                raise ShapeError(name, getattr(self, name).shape, str(self.probability.shape))

    def at(self, rows: np.ndarray) -> GoalBelief:
        """The belief of some rows."""
        return GoalBelief(self.probability[rows], self.speed_mps[rows], self.variance[rows])


def beliefs(
    seen: Observations, step: np.ndarray, time_s: np.ndarray, ground: Ground, routes: Routes, walking: Walking
) -> GoalBelief:
    """Filter all pedestrians together, instant by instant.

    Args:
        seen: observations, sorted by track and within a track by time. [M]
        step: counted from the first of a row of uninterrupted observations of a track. [M]
        time_s: of the observations. [M]
        ground: obstacles.
        routes: ways to the goals. [G]
        walking: how people walk.

    Returns:
        Row n knows the observations up to its instant. [M, G]
    """
    shape, crowd = (len(step), len(routes.target)), walking.model.crowd
    belief = GoalBelief(
        np.full(shape, 1.0 / shape[1]),
        np.full(shape, crowd.mean_speed_mps),
        np.full(shape, crowd.speed_deviation_mps**2),
    )
    for rows in instants(time_s):
        now = rows[step[rows] > 0]
        if len(now):
            prior, start, end = belief.at(now - 1), seen.at(now - 1), seen.at(now)
            acting = influences_between(
                start, end, walking.dt_s, prior.probability, ground, routes, walking.model.forces
            )
            arrived = arrival(start.position, end.position, routes.target, walking)
            noise = process_variance(prior, start.position, routes.target, arrived, walking)
            posterior = replace_reached(
                apply_bayes(prior, start, end, acting, noise, walking), arrived, walking.following
            )
            for name, values in vars(posterior).items():
                getattr(belief, name)[now] = values
    return belief


def process_variance(
    prior: GoalBelief, position: np.ndarray, places: np.ndarray, arrived: np.ndarray, walking: Walking
) -> np.ndarray:
    """Compute the variance of each velocity component about its prediction under each goal.

    Besides the noise, a goal somewhere within h of the place that stands for it, at the distance d: a point
    of a disc lies h / 2 aside (root mean square), so the direction is wrong by h / (2 d).

    Args:
        prior: belief at the start. [N, G]
        position: at the start, m. [N, 2]
        places: that stand for the goals, m. [G, 2]
        arrived: probability to have reached a goal in between. [N, G]
        walking: how people walk.

    Returns:
        s^2, m^2/s^2. [N, G]
    """
    noise = np.where(arrived > 0, _ARRIVING_MPS, walking.noise_mps) ** 2
    apart = np.linalg.norm(position[:, None] - places, axis=-1)
    astray = walking.spread_m / (2.0 * np.maximum(apart, walking.model.crowd.reach_m))
    return noise + ((1.0 - walking.keep) * prior.speed_mps * astray) ** 2


def apply_bayes(
    prior: GoalBelief,
    start: Observations,
    end: Observations,
    acting: Influences,
    noise: np.ndarray,
    walking: Walking,
) -> GoalBelief:
    """Apply Bayes' rule to goals and desired speeds, given the velocity at the end of an interval.

    With the gain k = (1 - a) e, the velocity is Gaussian about its prediction with the covariance
    s^2 I + P k k^T, P being the desired speed's variance. A small share of velocities is not explained.

    Args:
        prior: belief at the start. [N, G]
        start: of the interval. [N]
        end: of the interval. [N]
        acting: forces in between. [N, G]
        noise: s^2, m^2/s^2. [N, G]
        walking: how people walk.
    """
    gain = (1.0 - walking.keep) * acting.direction
    foreseen = walking.keep * start.velocity[:, None] + gain * prior.speed_mps[..., None]
    foreseen += (1.0 - walking.keep) * walking.model.forces.relaxation_time_s * acting.push
    miss = end.velocity[:, None] - foreseen
    along, squared = (gain * miss).sum(axis=-1), (miss**2).sum(axis=-1)
    spread = noise + prior.variance * (gain**2).sum(axis=-1)
    chi2 = (squared - along**2 * prior.variance / spread) / noise
    explained = (1.0 - _SURPRISE) * np.exp(-0.5 * chi2) / np.sqrt(noise * spread)
    surprise = _SURPRISE * np.exp(-0.5 * squared / _SURPRISE_MPS**2) / _SURPRISE_MPS**2
    weight = prior.probability * (explained + surprise)
    trust = explained / (explained + surprise) * prior.variance / spread
    return GoalBelief(
        weight / weight.sum(axis=1, keepdims=True),
        prior.speed_mps + trust * along,
        prior.variance * (1.0 - trust * (gain**2).sum(axis=-1)),
    )


def arrival(start: np.ndarray, end: np.ndarray, places: np.ndarray, walking: Walking) -> np.ndarray:
    """Compute the probability that goals were reached on straight segments; blurred at the edge of reach.

    The edge is as wide as the disc in which a goal may lie, or as paths are uncertain.

    Args:
        start: of the segments, m. [N, 2]
        end: of the segments, m. [N, 2]
        places: that stand for the goals, m. [G, 2]
        walking: how people walk.

    Returns:
        [N, G]
    """
    along, to = (end - start)[:, None], places[None] - start[:, None]
    length = np.maximum((along**2).sum(axis=-1), 1e-12)
    share = np.clip((to * along).sum(axis=-1) / length, 0.0, 1.0)
    nearest = np.linalg.norm(to - share[..., None] * along, axis=-1)
    blur_m = max(_BLUR_M, 2.0 * walking.spread_m)
    return np.clip((walking.model.crowd.reach_m - nearest) / blur_m + 0.5, 0.0, 1.0)


def replace_reached(belief: GoalBelief, arrived: np.ndarray, following: np.ndarray) -> GoalBelief:
    """Replace reached goals by those that may follow; mixed Gaussians keep their moments.

    Args:
        belief: before arrival. [N, G]
        arrived: probability to have reached each goal. [N, G]
        following: probability of each goal to follow another. [G, G]
    """
    leaving, staying = belief.probability * arrived, belief.probability * (1.0 - arrived)

    def mixed(values: np.ndarray) -> np.ndarray:
        return staying * values + (leaving * values) @ following

    mass = mixed(np.ones_like(staying))
    known = mass > 0
    share = np.where(known, mass, 1.0)
    mean = mixed(belief.speed_mps) / share
    variance = mixed(belief.variance + belief.speed_mps**2) / share - mean**2
    return GoalBelief(
        mass,
        np.where(known, mean, belief.speed_mps),
        np.where(known, np.maximum(variance, _LEAST_VARIANCE), belief.variance),
    )
