"""Who comes when, from where to where, with whom; values that all kinds of worlds share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pedpred.settings import Range
from pedpred.simulation.worlds.drawing import log_uniform, whole_number
from pedpred.simulation.worlds.floors import Floor, move_onto_free

REACH_M = 1.0
"""Distance at which people who come and leave have reached a target."""
LAST_S = 5.0
"""They come until this long after the end of the recording."""
MOST = 250
"""Largest number of people of a stream, or of a square."""


class Journeys(NamedTuple):
    """Journeys of N people, sorted by the time at which they come.

    Attributes:
        start_s: time of arrival; people wait outside while their place is taken. [N]
        entry: where they appear, m. [N, 2]
        plan: targets in order, padded with -1. [N, G] int64
        pause_s: time that they stand after reaching each of them but the last. [N, G]
        standing_s: time that they stand where they appear. [N]
        group: people with equal numbers walk together; -1: alone. [N] int64
    """

    start_s: np.ndarray
    entry: np.ndarray
    plan: np.ndarray
    pause_s: np.ndarray
    standing_s: np.ndarray
    group: np.ndarray

    def joined(self, other: Journeys) -> Journeys:
        """Append the journeys of other people and sort all by their start."""
        order = np.argsort(np.concatenate([self.start_s, other.start_s]), kind="stable")
        return Journeys(*(np.concatenate(pair)[order] for pair in zip(self, other, strict=True)))


class State(NamedTuple):
    """State of N people as they walk.

    Attributes:
        position: m. [N, 2]
        velocity: m/s. [N, 2]
        desired: unit vector e of the way that they want to go. [N, 2]
        turned: direction e' of the collision-free speed model. [N, 2]
        acceleration: m/s^2. [N, 2]
        noise: random acceleration, m/s^2. [N, 2]
        wander: standard normal processes of direction and speed. [N, 2]
        until: end of the present or last stop, s. [N]
        leg: index of the present target in the plan. [N] int64
        since_s: when each of them came; inf: not yet. [N]
        people: its first entries are the numbers of those who are there. [N] int64
    """

    position: np.ndarray
    velocity: np.ndarray
    desired: np.ndarray
    turned: np.ndarray
    acceleration: np.ndarray
    noise: np.ndarray
    wander: np.ndarray
    until: np.ndarray
    leg: np.ndarray
    since_s: np.ndarray
    people: np.ndarray

    @classmethod
    def before(cls, journeys: Journeys) -> State:
        """People who have not come yet."""
        count = len(journeys.start_s)
        velocity, desired, turned, acceleration, noise, wander = np.zeros((6, count, 2))
        return cls(
            position=journeys.entry.astype(float),
            velocity=velocity,
            desired=desired,
            turned=turned,
            acceleration=acceleration,
            noise=noise,
            wander=wander,
            until=np.zeros(count),
            leg=np.zeros(count, dtype=np.int64),
            since_s=np.full(count, np.inf),
            people=np.zeros(count, dtype=np.int64),
        )


class Visitors(NamedTuple):
    """The people of a world.

    Attributes:
        journeys: of all people.
        target: places that the plans refer to, m. [G, 2]
        dense: whether many people share the ground.
        stops: whether some people stop on their way.
        spacing_m: least distance to others when somebody appears.
        reach_m: distance at which a target counts as reached.
        leave: whether people leave at their last target; otherwise they stay there.
    """

    journeys: Journeys
    target: np.ndarray
    dense: bool
    stops: bool
    spacing_m: float
    reach_m: float
    leave: bool


class WorldSetup(NamedTuple):
    """A world before anybody walks.

    Attributes:
        floor: the ground.
        visitors: the people; their start counts from the beginning of the warm-up.
        whole_map: whether the map shows all that is not walkable; otherwise it may show walls only.
        closed_m: openings narrower than this are closed on the map, though people pass.
    """

    floor: Floor
    visitors: Visitors
    whole_map: bool
    closed_m: float = 0.0


def single(start_s: np.ndarray, entry: np.ndarray, goal: np.ndarray) -> Journeys:
    """Journeys of people who walk alone to one target each, without a stop; sorted by their start."""
    order, count = np.argsort(start_s, kind="stable"), len(start_s)
    plan = np.stack([goal[order], np.full(count, -1)], axis=1).astype(np.int64)
    nobody = np.full(count, -1, dtype=np.int64)
    return Journeys(start_s[order], entry[order], plan, np.zeros((count, 2)), np.zeros(count), nobody)


def form_groups(
    journeys: Journeys,
    share: float,
    sizes: tuple[int, int],
    apart_m: float,
    free: np.ndarray,
    rng: np.random.Generator,
) -> Journeys:
    """Let people who come one after the other walk together.

    Args:
        journeys: sorted by their start, all alone.
        share: probability that the next person is the first of a group.
        sizes: least and largest number of people in a group.
        apart_m: largest distance along each axis from the entry of the first person.
        free: walkable cells. [X, Y]
        rng: source of all randomness.
    """
    count = len(journeys.start_s)
    leader, person = np.arange(count), 0
    while person < count:
        size = whole_number(rng, sizes) if rng.random() < share else 1
        leader[person : person + size] = person
        person += size
    alone = np.bincount(leader, minlength=count)[leader] == 1
    follows = leader != np.arange(count)
    shift = rng.uniform(-apart_m, apart_m, (count, 2))
    entry = journeys.entry[leader]
    entry[follows] = move_onto_free(free, entry[follows] + shift[follows], 0.2)
    return Journeys(
        journeys.start_s[leader],
        entry,
        journeys.plan[leader],
        journeys.pause_s[leader],
        journeys.standing_s[leader],
        np.where(alone, -1, leader),
    )


def draw_number(area_m2: float, per_m2: Range, limits: tuple[int, int], rng: np.random.Generator) -> int:
    """Draw a density from a range (log-uniform) and return the number of people, within limits."""
    return int(np.clip(area_m2 * log_uniform(rng, per_m2), *limits))
