"""Streams of people between the entrances of a corridor or hall."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pedpred.settings import In, Range, Settings
from pedpred.simulation.worlds.drawing import check_shares, draw_name, log_uniform, uniform
from pedpred.simulation.worlds.floors import Floor, draw_points
from pedpred.simulation.worlds.journeys import LAST_S, MOST, REACH_M, Journeys, Visitors, form_groups, single

_TARGETS = 4  # per entrance
_WAITING_DEPTH_M = 6.0
_WAITING_SPACING_M = 0.35

_PATTERNS = ("one_way", "merging", "two_way", "all")


@dataclass(frozen=True)
class StreamSettings(Settings):
    """Ranges of the streams between entrances.

    Attributes:
        patterns: share of each: from one entrance to another, from all to one, there and back, all to all.
        right_angle_share: share of the crossings with two streams at right angles instead.
        dense_share: share of the worlds with dense streams.
        arrivals: people per second and metre of width, all streams together; log-uniform.
        dense_arrivals: the same where streams are dense.
        unequal: factor on the arrivals of each stream; log-uniform.
        waiting_per_m2: density of a crowd that waits from the start, if streams are dense; (0, 0) for none.
        waiting: largest size of that crowd.
        spacing_m: least distance to others when somebody appears.
        grouped_share: share of the sparse worlds with pairs.
        pair_share: probability in those that the next person is one of a pair.
        stopping_share: share of the worlds where people may stop.
    """

    patterns: Mapping[str, Annotated[float, In("[0, 1]")]]
    right_angle_share: Annotated[float, In("[0, 1]")]
    dense_share: Annotated[float, In("[0, 1]")]
    arrivals: Annotated[Range, In("(0, 1000]")]
    dense_arrivals: Annotated[Range, In("(0, 1000]")]
    unequal: Annotated[Range, In("(0, 1000]")]
    waiting_per_m2: Annotated[Range, In("[0, 1000]")]
    waiting: Annotated[int, In("[0, 1000]")]
    spacing_m: Annotated[Range, In("(0, 1000]")]
    grouped_share: Annotated[float, In("[0, 1]")]
    pair_share: Annotated[float, In("[0, 1]")]
    stopping_share: Annotated[float, In("[0, 1]")]

    def __post_init__(self) -> None:
        super().__post_init__()
        check_shares(self, "patterns", _PATTERNS)


def draw_streams(
    floor: Floor, settings: StreamSettings, duration_s: float, rng: np.random.Generator
) -> Visitors:
    """Draw the people who walk between the entrances of a floor during some time (with the warm-up)."""
    dense = bool(rng.random() < settings.dense_share)
    pairs = _pairs(floor, settings, rng)
    target = np.concatenate([draw_points(floor.free, area, _TARGETS, 0.35, rng) for area in floor.entrances])
    rate = log_uniform(rng, settings.dense_arrivals if dense else settings.arrivals) * floor.narrow_m
    end_s, spacing_m = duration_s + LAST_S, uniform(rng, settings.spacing_m)
    parts = []
    for origin, exit_ in pairs:
        expected = rate / len(pairs) * log_uniform(rng, settings.unequal) * end_s
        start_s = rng.uniform(0.0, end_s, min(int(expected) + 1, MOST))
        parts.append(_stream(floor, start_s, origin, exit_, 0.3, rng))
    if dense and settings.waiting_per_m2[1] > 0:
        per_m2 = uniform(rng, settings.waiting_per_m2)
        waiting = min(int(per_m2 * floor.width_m * _WAITING_DEPTH_M), settings.waiting)
        parts.append(_stream(floor, np.zeros(waiting), *pairs[0], 0.2, rng))
        spacing_m = _WAITING_SPACING_M
    journeys = parts[0]
    for part in parts[1:]:
        journeys = journeys.joined(part)
    if not dense and rng.random() < settings.grouped_share:
        journeys = form_groups(journeys, settings.pair_share, (2, 2), 0.5, floor.free, rng)
    stops = bool(rng.random() < settings.stopping_share)
    return Visitors(journeys, target, dense, stops, spacing_m, REACH_M, True)


def _stream(
    floor: Floor, start_s: np.ndarray, origin: int, exit_: int, clear_m: float, rng: np.random.Generator
) -> Journeys:
    entry = draw_points(floor.free, floor.entrances[origin], len(start_s), clear_m, rng)
    return single(start_s, entry, exit_ * _TARGETS + rng.integers(_TARGETS, size=len(start_s)))


def _pairs(floor: Floor, settings: StreamSettings, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Entrance and exit of each stream."""
    count = len(floor.entrances)
    if floor.crossed and rng.random() < settings.right_angle_share:
        return [(0, 1), (2, 3)] if rng.random() < 0.5 else [(1, 0), (2, 3)]
    pattern = draw_name(rng, settings.patterns)
    a, b = (int(n) for n in rng.choice(count, 2, replace=False))
    if pattern == "one_way":
        return [(a, b)]
    if pattern == "merging":
        return [(n, b) for n in range(count) if n != b]
    if pattern == "two_way":
        return [(a, b), (b, a)]
    return [(n, m) for n in range(count) for m in range(count) if n != m]
