"""What a room must offer before anybody walks in it: ground, a way to all of it, and room for everybody."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import ndimage

from pedpred.errors import ConfigError
from pedpred.simulation.ground import Ground, ground_of
from pedpred.simulation.layouts import Layout
from pedpred.simulation.placement import drawn_targets, largest_part, open_cells, scattered, walkable
from pedpred.simulation.routing import RoutingSettings, clearance_grid
from pedpred.simulation.settings import CrowdSettings, SocialForceSettings
from pedpred.simulation.shapes import kind_of

SEALED_M2 = 1.0
"""A part of this area that nobody can get to is a closed room; less is a nook between obstacles."""


def check_room(layout: Layout, ground: Ground, settings: SocialForceSettings, key: str) -> None:
    """Refuse a drawn room in which people cannot walk everywhere.

    Args:
        layout: the room.
        ground: of the same room.
        settings: how much space people and their routes need.
        key: where the layout stands in the configuration, for the errors.

    Raises:
        ConfigError: no ground is free, nobody gets to a target region, or obstacles close off a part.
    """
    clearance_m, regions = settings.crowd.clearance_m, layout.target_regions
    cells = open_cells(ground, clearance_m)
    if not len(cells):
        cause = "shapes" if layout.shapes else "size_m"
        rule = f"there is no free ground: nowhere are obstacles {clearance_m} m away"
        raise ConfigError(f"{key}.{cause}", getattr(layout, cause), rule)
    if len(regions) == 1:
        rule = "people walk from one region to another: draw a second one, or none for targets all over"
        raise ConfigError(f"{key}.target_regions", regions, rule)
    for n, region in enumerate(regions):
        if not region.covers(cells).any():
            rule = f"people cannot get there with {clearance_m} m of free ground around them"
            raise ConfigError(f"{key}.target_regions[{n}].{kind_of(region)}", region, rule)
    area_m2, place = sealed_part(ground, settings.routing)
    if area_m2 > SEALED_M2:
        _blame(layout, area_m2, place, settings.routing, key)


def check_crowd(
    name: str,
    layout: Layout,
    ground: Ground,
    pedestrians: int,
    settings: CrowdSettings,
    rng: np.random.Generator,
) -> None:
    """Refuse more people than find room, or nowhere to walk to, by the draws that a simulation begins with.

    Args:
        name: of the room, for the error.
        layout: the room.
        ground: of the same room.
        pedestrians: how many want to start there.
        settings: the space that each of them needs.
        rng: in the state in which the simulation will begin.

    Raises:
        ConfigError: fewer find room, or there is one target only.
    """
    pool = drawn_targets(layout, ground, settings, rng)
    if len(np.unique(pool.region)) < 2:
        remedy = f"room '{name}' is too small for two targets {settings.target_spacing_m} m apart"
        raise ConfigError("size_m", layout.size_m, remedy)
    cells = open_cells(ground, settings.clearance_m)
    fit = len(scattered(cells, pedestrians, settings.spacing_m, rng))
    if fit < pedestrians:
        remedy = f"only {fit} find room in '{name}', {settings.spacing_m} m apart"
        raise ConfigError("pedestrians", pedestrians, remedy)


def sealed_part(ground: Ground, settings: RoutingSettings) -> tuple[float, np.ndarray]:
    """The largest part of the ground that people have room on and no route leads to.

    Returns:
        Its area, m^2, and its centre, world frame, m [2]; (0, origin) where there is none.
    """
    clearance = clearance_grid(ground, settings.resolution_m)
    reached = walkable(clearance, settings.narrow_m)
    lost = (clearance >= settings.narrow_m) & ~reached
    if not lost.any():
        return 0.0, ground.origin
    reach = settings.narrow_m / settings.resolution_m  # who stands on a cell covers what is around it
    ours, theirs = (ndimage.distance_transform_edt(~cells) <= reach for cells in (lost, reached))
    part = np.argwhere(largest_part(ours & ~theirs & (clearance > 0)))
    center = part.mean(axis=0) + 0.5 if len(part) else np.zeros(2)
    return len(part) * settings.resolution_m**2, ground.origin + center * settings.resolution_m


def _blame(layout: Layout, area_m2: float, place: np.ndarray, settings: RoutingSettings, key: str) -> None:
    """Raise an error about the first obstacle without which less ground would be closed off."""
    x, y = np.round(place, 1).tolist()
    wide_m = 2 * settings.narrow_m + settings.resolution_m
    rule = f"nobody gets to {area_m2:.1f} m2 around ({x}, {y}); leave a way more than {wide_m:.1f} m wide"
    for n, shape in enumerate(layout.shapes):
        others = replace(layout, shapes=[*layout.shapes[:n], *layout.shapes[n + 1 :]])
        if sealed_part(ground_of(others.occupancy()), settings)[0] < area_m2:
            raise ConfigError(f"{key}.shapes[{n}].{kind_of(shape)}", shape, rule)
    raise ConfigError(f"{key}.shapes", layout.shapes, rule)
