"""The rooms of a simulated data set: layout, number of people, duration and random state of each."""

from __future__ import annotations

import copy
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import Scene
from pedpred.simulation.admission import check_crowd, check_room
from pedpred.simulation.clutter import ClutterSettings, cluttered_room
from pedpred.simulation.ground import ground_of
from pedpred.simulation.layouts import Layout, layout_from
from pedpred.simulation.placement import drawn_targets
from pedpred.simulation.settings import SimulationSettings, SocialForceSettings
from pedpred.simulation.simulator import simulate


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


def parsed_layouts(
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
        check_room(layout, ground_of(layout.occupancy()), settings, name)
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
    made, found = rooms(data_set, layouts, clutter), []
    for name, (layout, rng) in made.items():
        duration_s = 3600.0 * data_set.hours / len(made)
        arrangement = Arrangement(name, layout, rng, data_set.pedestrians, duration_s)
        ground = ground_of(layout.occupancy())
        check_crowd(name, layout, ground, data_set.pedestrians, settings.crowd, arrangement.rng())
        found.append(arrangement)
    return found


def rooms(
    data_set: SimulationSettings, layouts: Mapping[str, Layout], clutter: ClutterSettings
) -> dict[str, tuple[Layout, np.random.Generator]]:
    """The rooms of a data set by name, and the random state in which each is simulated.

    Raises:
        ValueRuleError: a layout is unknown.
    """
    found = {}
    for name in data_set.rooms:
        rng = np.random.default_rng([data_set.seed, zlib.crc32(name.encode())])
        if name not in data_set.drawn:
            found[name] = (cluttered_room(clutter, rng), rng)
        elif name in layouts:
            found[name] = (layouts[name], rng)
        else:
            raise ValueRuleError("drawn", name, f"there is no such layout; known ones are {sorted(layouts)}")
    return found


def simulated(arrangement: Arrangement, settings: SocialForceSettings) -> Scene:
    """Draw targets and simulate one room."""
    rng, occupancy = arrangement.rng(), arrangement.layout.occupancy()
    targets = drawn_targets(arrangement.layout, ground_of(occupancy), settings.crowd, rng)
    people, duration_s = arrangement.pedestrians, arrangement.duration_s
    return simulate(arrangement.name, occupancy, targets, settings, people, duration_s, rng)
