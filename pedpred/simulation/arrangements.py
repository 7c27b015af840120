"""The rooms of a simulated data set: layout, number of people, duration and random state; checks of each."""

from __future__ import annotations

import copy
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import ndimage

from pedpred.errors import ValueRuleError
from pedpred.scenes import Scene
from pedpred.simulation.clutter import ClutterSettings, draw_cluttered_room
from pedpred.simulation.ground import Ground, ground_of
from pedpred.simulation.layouts import Layout, draw_targets, largest_part, layout_from, open_cells, scattered
from pedpred.simulation.routing import clearance_grid
from pedpred.simulation.settings import (
    CrowdSettings,
    RoutingSettings,
    SimulationSettings,
    SocialForceSettings,
)
from pedpred.simulation.shapes import kind_of
from pedpred.simulation.simulator import simulate

SEALED_M2 = 1.0
"""Unreachable parts larger than this count as closed rooms; smaller ones are gaps between obstacles."""


@dataclass(frozen=True)
class Arrangement:
    """One room to be simulated.

    Attributes:
        name: unique within its data set; also the folder's name.
        layout: the room.
        initial_rng: random state at the start of the simulation; use copies, see `rng`.
        pedestrians: number of people.
        duration_s: recorded time.
    """

    name: str
    layout: Layout
    initial_rng: np.random.Generator
    pedestrians: int
    duration_s: float

    def rng(self) -> np.random.Generator:
        """A fresh copy of the initial random state, so that results do not depend on the order of rooms."""
        return copy.deepcopy(self.initial_rng)


def parse_layouts(
    plain: Mapping[str, Any], names: Iterable[str], settings: SocialForceSettings
) -> dict[str, Layout]:
    """Parse and check some drawn layouts; names that do not exist are left out.

    Args:
        plain: name -> layout, see `layout_from`.
        names: the layouts to parse.
        settings: space that people and routes need.

    Raises:
        ValueRuleError: a layout is malformed, or people cannot walk in it.
    """
    layouts = {name: layout_from(plain[name], name) for name in names if name in plain}
    for name, layout in layouts.items():
        _check_room(layout, settings, name)
    return layouts


def arrangements(
    data_set: SimulationSettings,
    layouts: Mapping[str, Layout],
    clutter: ClutterSettings,
    settings: SocialForceSettings,
) -> list[Arrangement]:
    """Make and check all rooms of a data set before the first one is simulated.

    Args:
        data_set: which rooms, how many people, how long.
        layouts: drawn rooms by name.
        clutter: parameters of the generated rooms.
        settings: space that people need.

    Raises:
        ValueRuleError: a layout is unknown, or a room is too small for its people.
    """
    made = rooms(data_set, layouts, clutter)
    people, duration_s = data_set.pedestrians, 3600.0 * data_set.hours / len(made)
    drawn = [Arrangement(name, layout, rng, people, duration_s) for name, (layout, rng) in made.items()]
    for arrangement in drawn:
        _check_crowd(arrangement, settings.crowd)
    return drawn


def rooms(
    data_set: SimulationSettings, layouts: Mapping[str, Layout], clutter: ClutterSettings
) -> dict[str, tuple[Layout, np.random.Generator]]:
    """The rooms of a data set by name, and the random state in which each is simulated.

    Raises:
        ValueRuleError: a layout is unknown.
    """
    drawn = {}
    for name in data_set.rooms:
        rng = np.random.default_rng([data_set.seed, zlib.crc32(name.encode())])
        if name not in data_set.drawn:
            drawn[name] = (draw_cluttered_room(clutter, rng), rng)
        elif name in layouts:
            drawn[name] = (layouts[name], rng)
        else:
            raise ValueRuleError("drawn", name, f"there is no such layout; known ones are {sorted(layouts)}")
    return drawn


def simulate_arrangement(arrangement: Arrangement, settings: SocialForceSettings) -> Scene:
    """Draw targets and simulate one room."""
    rng, occupancy = arrangement.rng(), arrangement.layout.occupancy()
    targets = draw_targets(arrangement.layout, ground_of(occupancy), settings.crowd, rng)
    people, duration_s = arrangement.pedestrians, arrangement.duration_s
    return simulate(arrangement.name, occupancy, targets, settings, people, duration_s, rng)


def _check_room(layout: Layout, settings: SocialForceSettings, path: str) -> None:
    """Refuse a drawn room without free ground, or with unreachable ground or targets."""
    clearance_m, regions = settings.crowd.clearance_m, layout.target_regions
    ground = ground_of(layout.occupancy())
    cells = open_cells(ground, clearance_m)
    if not len(cells):
        cause = "shapes" if layout.shapes else "size_m"
        rule = f"there is no free ground: nowhere is the clearance {clearance_m} m"
        raise ValueRuleError(f"{path}.{cause}", getattr(layout, cause), rule)
    if len(regions) == 1:
        rule = "people walk between regions: draw a second one, or none for targets all over the room"
        raise ValueRuleError(f"{path}.target_regions", regions, rule)
    for n, region in enumerate(regions):
        if not region.covers(cells).any():
            rule = f"people cannot get there with {clearance_m} m of free ground around them"
            raise ValueRuleError(f"{path}.target_regions[{n}].{kind_of(region)}", region, rule)
    area_m2, place = find_sealed_part(ground, settings.routing)
    if area_m2 > SEALED_M2:
        _raise_sealed(layout, area_m2, place, settings.routing, path)


def _check_crowd(room: Arrangement, settings: CrowdSettings) -> None:
    """Refuse too many people, or a room with one target, by repeating the first draws of the simulation."""
    ground, rng = ground_of(room.layout.occupancy()), room.rng()
    pool = draw_targets(room.layout, ground, settings, rng)
    if len(np.unique(pool.region)) < 2:
        rule = f"it is too small for two targets {settings.target_spacing_m} m apart"
        raise ValueRuleError(f"rooms.{room.name}.size_m", room.layout.size_m, rule)
    cells = open_cells(ground, settings.clearance_m)
    fit = len(scattered(cells, room.pedestrians, settings.spacing_m, rng))
    if fit < room.pedestrians:
        rule = f"only {fit} fit into room '{room.name}', {settings.spacing_m} m apart"
        raise ValueRuleError("pedestrians", room.pedestrians, rule)


def find_sealed_part(ground: Ground, settings: RoutingSettings) -> tuple[float, np.ndarray]:
    """Find the largest part of the ground that is wide enough for people but cannot be reached.

    Returns:
        Its area, m^2, and its centre, world frame, m [2]; (0, origin) where there is none.
    """
    clearance = clearance_grid(ground, settings.resolution_m)
    wide = clearance >= settings.narrow_m
    reached = largest_part(wide)
    lost = wide & ~reached
    if not lost.any():
        return 0.0, ground.origin
    reach = settings.narrow_m / settings.resolution_m  # a person on a cell covers its surroundings
    ours, theirs = (ndimage.distance_transform_edt(~cells) <= reach for cells in (lost, reached))
    part = np.argwhere(largest_part(ours & ~theirs & (clearance > 0)))
    center = part.mean(axis=0) + 0.5 if len(part) else np.zeros(2)
    return len(part) * settings.resolution_m**2, ground.origin + center * settings.resolution_m


def _raise_sealed(
    layout: Layout, area_m2: float, place: np.ndarray, settings: RoutingSettings, path: str
) -> None:
    """Raise an error about the first obstacle whose removal leaves less ground closed off."""
    x, y = np.round(place, 1).tolist()
    wide_m = 2 * settings.narrow_m + settings.resolution_m
    rule = f"it closes off {area_m2:.1f} m2 around ({x}, {y}); leave an opening wider than {wide_m:.1f} m"
    for n, shape in enumerate(layout.shapes):
        others = replace(layout, shapes=[*layout.shapes[:n], *layout.shapes[n + 1 :]])
        if find_sealed_part(ground_of(others.occupancy()), settings)[0] < area_m2:
            raise ValueRuleError(f"{path}.shapes[{n}].{kind_of(shape)}", shape, rule)
    raise ValueRuleError(f"{path}.shapes", layout.shapes, rule)
