"""What distinguishes the people of a world: speed, reactions, size, habit of stopping."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from pedpred.settings import In, Range, Settings
from pedpred.simulation.worlds.drawing import check_shares, draw_name, log_uniform, uniform


class Traits(NamedTuple):
    """Traits of N people.

    Attributes:
        desired_speed: v0, m/s. [N]
        relaxation_s: tau. [N]
        radius_m: of the body. [N]
        headway_s: T, least time to the person ahead; 0: not kept. [N]
        stop_rate_hz: stops per second on the way. [N]
        stop_s: mean length of a stop. [N]
        pull_mps2: acceleration towards the members of the own group. [N]
    """

    desired_speed: np.ndarray
    relaxation_s: np.ndarray
    radius_m: np.ndarray
    headway_s: np.ndarray
    stop_rate_hz: np.ndarray
    stop_s: np.ndarray
    pull_mps2: np.ndarray


_PACES = ("usual", "slow", "fast")
_RELAXATION_S = (0.2, 2.0)  # those drawn beyond are clipped


@dataclass(frozen=True)
class PeopleSettings(Settings):
    """Ranges of the traits; each world draws its own means.

    Attributes:
        paces: share of the worlds with usual, slow and fast people.
        usual_mps: mean desired speed of a world.
        slow_mps: the same.
        fast_mps: the same.
        speed_deviation: standard deviation of the desired speed between people, as a share of the mean.
        speed_range_mps: desired speeds are clipped to this.
        relaxation_s: of social forces; log-uniform.
        collision_free_relaxation_s: of the collision-free speed model; log-uniform.
        radius_m: of bodies.
        headway_share: share of the sparse worlds with social forces where people keep their distance; in
            all others they do.
        headway_s: mean of a world; log-uniform.
        stops_share: share of the worlds in which people stop.
        stopping_people: share of the people in those who do.
        stop_rate_hz: of a world; log-uniform.
        stop_s: mean of a world; log-uniform.
        pull_mps2: of groups.
    """

    paces: Mapping[str, Annotated[float, In("[0, 1]")]]
    usual_mps: Annotated[Range, In("(0, 1000]")]
    slow_mps: Annotated[Range, In("(0, 1000]")]
    fast_mps: Annotated[Range, In("(0, 1000]")]
    speed_deviation: Annotated[Range, In("[0, 1]")]
    speed_range_mps: Annotated[Range, In("(0, 1000]")]
    relaxation_s: Annotated[Range, In("(0, 1000]")]
    collision_free_relaxation_s: Annotated[Range, In("(0, 1000]")]
    radius_m: Annotated[Range, In("[0.05, 0.5]")]
    headway_share: Annotated[float, In("[0, 1]")]
    headway_s: Annotated[Range, In("(0, 1000]")]
    stops_share: Annotated[float, In("[0, 1]")]
    stopping_people: Annotated[float, In("[0, 1]")]
    stop_rate_hz: Annotated[Range, In("(0, 1000]")]
    stop_s: Annotated[Range, In("(0, 1000]")]
    pull_mps2: Annotated[Range, In("[0, 1000]")]

    def __post_init__(self) -> None:
        super().__post_init__()
        check_shares(self, "paces", _PACES)


def draw_traits(
    group: np.ndarray,
    settings: PeopleSettings,
    collision_free: bool,
    dense: bool,
    stops: bool,
    rng: np.random.Generator,
) -> Traits:
    """Draw the traits of the people of a world; members of a group have equal ones.

    Args:
        group: people with equal numbers walk together; -1: alone. [N]
        settings: ranges.
        collision_free: whether the collision-free speed model moves them.
        dense: whether many people share the ground.
        stops: whether people may stop on the way.
        rng: source of all randomness.
    """
    count = len(group)
    mean_mps = uniform(rng, getattr(settings, f"{draw_name(rng, settings.paces)}_mps"))
    speed = rng.normal(mean_mps, uniform(rng, settings.speed_deviation) * mean_mps, count)
    tau_s = settings.collision_free_relaxation_s if collision_free else settings.relaxation_s
    relaxation_s = log_uniform(rng, tau_s) * np.exp(rng.normal(0.0, 0.2, count))
    radius_m = uniform(rng, settings.radius_m) + rng.uniform(-0.02, 0.02, count)
    keeps = collision_free or dense or rng.random() < settings.headway_share
    headway_s = log_uniform(rng, settings.headway_s) * np.exp(rng.normal(0.0, 0.2, count)) * keeps
    stops = stops and rng.random() < settings.stops_share
    stop_rate_hz = log_uniform(rng, settings.stop_rate_hz) * (rng.random(count) < settings.stopping_people)
    traits = Traits(
        desired_speed=np.clip(speed, *settings.speed_range_mps),
        relaxation_s=np.clip(relaxation_s, *_RELAXATION_S),
        radius_m=radius_m,
        headway_s=headway_s,
        stop_rate_hz=stop_rate_hz * stops,
        stop_s=np.full(count, log_uniform(rng, settings.stop_s)),
        pull_mps2=np.full(count, uniform(rng, settings.pull_mps2)),
    )
    _, first, number = np.unique(group, return_index=True, return_inverse=True)
    leader = np.where(group >= 0, first[number], np.arange(count))  # whose traits a person has
    return Traits(**{name: values[leader] for name, values in traits._asdict().items()})
