"""Open squares and streets: nothing, posts and boxes, or walls along the sides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pedpred.settings import In, Range, Settings
from pedpred.simulation.worlds.drawing import check_shares, draw_name, uniform, whole_number
from pedpred.simulation.worlds.floors import Area, Floor, ground_cells, paint_disc, paint_rectangle
from pedpred.simulation.worlds.journeys import WorldSetup
from pedpred.simulation.worlds.strolls import StrollSettings, draw_strolls

_EDGE = 0.03  # distance of entrances from the edge, as a share of the side


_OBSTACLES = ("none", "posts", "walls", "both")


@dataclass(frozen=True)
class SquareSettings(Settings):
    """Ranges of open squares.

    Attributes:
        duration_s: recorded time.
        side_m: of the square.
        obstacles: share of squares with each kind of obstacles.
        posts: number of posts and boxes.
        post_radius_m: of the posts.
        box_m: half sides of boxes.
        door_m: width of the door in a wall.
        entrances: number of places where people come from.
        street_share: share of the squares with two entrances at opposite ends.
        entrance_m: people come in within this distance, along each axis, of an entrance.
        strolls: who walks.
    """

    duration_s: Annotated[float, In("(0, 36000]")]
    side_m: Annotated[Range, In("[10, 1000]")]
    obstacles: Mapping[str, Annotated[float, In("[0, 1]")]]
    posts: Annotated[tuple[int, int], In("[0, 1000]")]
    post_radius_m: Annotated[Range, In("(0, 1000]")]
    box_m: Annotated[Range, In("(0, 1000]")]
    door_m: Annotated[Range, In("(0, 1000]")]
    entrances: Annotated[tuple[int, int], In("[2, 1000]")]
    street_share: Annotated[float, In("[0, 1]")]
    entrance_m: Annotated[Range, In("(0, 1000]")]
    strolls: StrollSettings

    def __post_init__(self) -> None:
        super().__post_init__()
        check_shares(self, "obstacles", _OBSTACLES)


def draw_square(settings: SquareSettings, rng: np.random.Generator) -> Floor:
    """Draw a square; the ground goes on beyond its edges."""
    size = rng.uniform(*settings.side_m, 2)
    free = ground_cells(size, True)
    obstacles = draw_name(rng, settings.obstacles)
    if obstacles in ("posts", "both"):
        _place_posts(free, size, settings, rng)
    if obstacles in ("walls", "both"):
        _place_walls(free, size, settings, rng)
    spread = uniform(rng, settings.entrance_m)
    entrances = []
    for place in _edge_places(size, settings, rng):
        low, high = np.clip(np.stack([place - spread, place + spread]), 0.3, size - 0.3)
        entrances.append(Area(low, high))
    return Floor(free, tuple(entrances), float(size.min()), float(size.min()))


def set_up_square(settings: SquareSettings, duration_s: float, rng: np.random.Generator) -> WorldSetup:
    """Draw a square and its people during some time (with the warm-up)."""
    floor = draw_square(settings, rng)
    return WorldSetup(floor, draw_strolls(floor, settings.strolls, duration_s, rng), whole_map=True)


def _place_posts(
    free: np.ndarray, size: np.ndarray, settings: SquareSettings, rng: np.random.Generator
) -> None:
    for _ in range(whole_number(rng, settings.posts)):
        place = rng.uniform(0.1 * size, 0.9 * size)
        if rng.random() < 0.5:
            paint_disc(free, place, uniform(rng, settings.post_radius_m))
        else:
            half = rng.uniform(*settings.box_m, 2)
            paint_rectangle(free, place - half, place + half, False)


def _place_walls(
    free: np.ndarray, size: np.ndarray, settings: SquareSettings, rng: np.random.Generator
) -> None:
    """A building along the lower side, half of them with a doorway; some have another one opposite."""
    depth, left = uniform(rng, (1.0, 0.3 * size[1])), uniform(rng, (0.0, 0.7 * size[0]))
    paint_rectangle(free, (0.0, 0.0), (size[0], depth), False)
    if rng.random() < 0.5:
        paint_rectangle(free, (left, 0.0), (left + uniform(rng, settings.door_m), depth), True)
    if rng.random() < 0.3:
        paint_rectangle(free, (0.0, size[1] - rng.uniform(0.5, 2.0)), (size[0], size[1] + 1.0), False)


def _edge_places(size: np.ndarray, settings: SquareSettings, rng: np.random.Generator) -> np.ndarray:
    """Centres of the entrances, m: the two ends of a street, or points on any side. [E, 2]."""
    if rng.random() < settings.street_share:
        along = np.arange(2) == rng.integers(2)
        return size * np.where(along, [[_EDGE], [1.0 - _EDGE]], 0.5)
    count = whole_number(rng, settings.entrances)
    places = rng.uniform(0.1, 0.9, (count, 2))
    axis = rng.integers(2, size=count)
    places[np.arange(count), axis] = np.where(rng.random(count) < 0.5, _EDGE, 1.0 - _EDGE)
    return size * places
