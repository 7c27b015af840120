"""People who cross an open square, alone or in groups, and clusters of people who stand there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pedpred.settings import In, Range, Settings
from pedpred.simulation.worlds.drawing import log_uniform, uniform, whole_number
from pedpred.simulation.worlds.floors import Floor, move_onto_free
from pedpred.simulation.worlds.journeys import LAST_S, MOST, REACH_M, Journeys, Visitors, form_groups, single

_TARGETS = 5  # per entrance
_CLEAR_M = 0.4
_SPACING_M = 0.3
_CLUSTER_M = 0.8  # standard deviation of the places in a cluster


@dataclass(frozen=True)
class StrollSettings(Settings):
    """Ranges of people on open squares.

    Attributes:
        arrivals: people per second; log-uniform.
        dense_share: share of the dense worlds.
        dense_factor: on their arrivals.
        detour_share: share of the worlds where some people go somewhere else first.
        detour_people: share of those people.
        pausing_people: share of the detours with a pause.
        pause_s: mean pause.
        grouped_share: share of the worlds with groups.
        groups: probability in those that the next person is the first of a group.
        group_size: least and largest number of people in a group.
        standing_share: share of the worlds with standing people.
        standing: their number.
        cluster: people per cluster.
        standing_s: least and mean further time that they stand.
    """

    arrivals: Annotated[Range, In("(0, 1000]")]
    dense_share: Annotated[float, In("[0, 1]")]
    dense_factor: Annotated[float, In("(0, 1000]")]
    detour_share: Annotated[float, In("[0, 1]")]
    detour_people: Annotated[float, In("[0, 1]")]
    pausing_people: Annotated[Range, In("[0, 1]")]
    pause_s: Annotated[float, In("(0, 1000]")]
    grouped_share: Annotated[float, In("[0, 1]")]
    groups: Annotated[Range, In("[0, 1]")]
    group_size: Annotated[tuple[int, int], In("[1, 1000]")]
    standing_share: Annotated[float, In("[0, 1]")]
    standing: Annotated[tuple[int, int], In("[1, 1000]")]
    cluster: Annotated[int, In("[1, 1000]")]
    standing_s: Annotated[Range, In("[0, 1000]")]


def draw_strolls(
    floor: Floor, settings: StrollSettings, duration_s: float, rng: np.random.Generator
) -> Visitors:
    """Draw the people of a square during some time (with the warm-up)."""
    dense = bool(rng.random() < settings.dense_share)
    rate = log_uniform(rng, settings.arrivals) * (settings.dense_factor if dense else 1.0)
    end_s, entrances = duration_s + LAST_S, len(floor.entrances)
    count = min(int(rate * end_s) + 2, MOST)
    drawn = [rng.uniform(area.low, area.high, (_TARGETS, 2)) for area in floor.entrances]
    target = move_onto_free(floor.free, np.concatenate(drawn), _CLEAR_M)
    start_s = np.sort(rng.uniform(0.0, end_s, count))
    origin = rng.integers(entrances, size=count)
    exit_ = (origin + rng.integers(1, entrances, size=count)) % entrances
    near = target[origin * _TARGETS + rng.integers(_TARGETS, size=count)]
    entry = move_onto_free(floor.free, near + rng.uniform(-0.5, 0.5, (count, 2)), 0.2)
    journeys = single(start_s, entry, exit_ * _TARGETS + rng.integers(_TARGETS, size=count))
    if rng.random() < settings.detour_share:
        journeys = _with_detours(journeys, len(target), settings, rng)
    if rng.random() < settings.grouped_share:
        share = uniform(rng, settings.groups)
        journeys = form_groups(journeys, share, settings.group_size, 1.0, floor.free, rng)
    if rng.random() < settings.standing_share:
        journeys = journeys.joined(_standing(floor, len(target), settings, rng))
    return Visitors(journeys, target, dense, True, _SPACING_M, REACH_M, True)


def _with_detours(
    journeys: Journeys, targets: int, settings: StrollSettings, rng: np.random.Generator
) -> Journeys:
    """Let some people go to any other target first, and perhaps pause there."""
    count = len(journeys.plan)
    first = rng.integers(targets, size=count)
    away = (rng.random(count) < settings.detour_people) & (first != journeys.plan[:, 0])
    plan = np.where(away[:, None], np.stack([first, journeys.plan[:, 0]], axis=1), journeys.plan)
    pauses = away & (rng.random(count) < uniform(rng, settings.pausing_people))
    pause_s = np.zeros((count, 2))
    pause_s[:, 0] = np.where(pauses, rng.exponential(settings.pause_s, count), 0.0)
    return journeys._replace(plan=plan, pause_s=pause_s)


def _standing(floor: Floor, targets: int, settings: StrollSettings, rng: np.random.Generator) -> Journeys:
    """People who stand in clusters from the start, and walk off some time."""
    count, size = whole_number(rng, settings.standing), floor.size_m
    center = rng.uniform(0.2 * size, 0.8 * size, (max(count // settings.cluster, 1), 2))
    place = center[rng.integers(len(center), size=count)] + rng.normal(0.0, _CLUSTER_M, (count, 2))
    place = move_onto_free(floor.free, np.clip(place, 0.5, size - 0.5), 0.3)
    standing = single(np.zeros(count), place, rng.integers(targets, size=count))
    least_s, mean_s = settings.standing_s
    return standing._replace(standing_s=least_s + rng.exponential(mean_s, count))
