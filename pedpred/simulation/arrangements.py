"""The arrangements of a simulated data set: which rooms, how long, and with which random numbers."""

from __future__ import annotations

import copy
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.errors import ConfigError
from pedpred.scenes import Scene
from pedpred.simulation.admission import check_crowd, check_room
from pedpred.simulation.clutter import clutter_settings, cluttered_room
from pedpred.simulation.ground import ground_of
from pedpred.simulation.layouts import Layout, layout_from
from pedpred.simulation.placement import drawn_targets
from pedpred.simulation.settings import SocialForceSettings
from pedpred.simulation.simulator import simulate


@dataclass(frozen=True)
class Arrangement:
    """One room to be simulated.

    Attributes:
        name: unique within its data set; also the folder's name.
        layout: the room.
        chance: what is left to chance is drawn from a copy of it, see `rng`.
        pedestrians: how many walk there.
        duration_s: recorded time.
    """

    name: str
    layout: Layout
    chance: np.random.Generator
    pedestrians: int
    duration_s: float

    def __post_init__(self) -> None:
        if not self.pedestrians >= 1:
            raise ConfigError("pedestrians", self.pedestrians, "one at least must walk")
        if not self.duration_s > 0:
            raise ConfigError("hours", self.duration_s / 3600.0, "it must be positive")

    def rng(self) -> np.random.Generator:
        """The same numbers wherever, how often and in whichever order arrangements are simulated."""
        return copy.deepcopy(self.chance)


def arrangements(
    scene: Mapping[str, Any],
    layouts: Mapping[str, Any],
    clutter: Mapping[str, Any],
    settings: SocialForceSettings,
) -> list[Arrangement]:
    """Return what a row of conf/simulations asks for; all arrangements share its hours equally.

    Every room is made and checked here, so whatever is wrong with one is said before any is simulated.

    Args:
        scene: `pedestrians`, `hours`, and what `rooms` reads.
        layouts: drawn rooms by name, see `layout_from`.
        clutter: what the generator draws from.
        settings: how much space people and their routes need.

    Raises:
        ConfigError: nothing to simulate, a room that is not understood or in which so
            many people cannot walk.
    """
    made, found = rooms(scene, layouts, clutter, settings), []
    for name, (layout, chance) in made.items():
        duration_s = 3600.0 * scene["hours"] / len(made)
        arrangement = Arrangement(name, layout, chance, scene["pedestrians"], duration_s)
        ground = ground_of(layout.occupancy())
        check_crowd(name, layout, ground, scene["pedestrians"], settings.crowd, arrangement.rng())
        found.append(arrangement)
    return found


def rooms(
    scene: Mapping[str, Any],
    layouts: Mapping[str, Any],
    clutter: Mapping[str, Any],
    settings: SocialForceSettings,
) -> dict[str, tuple[Layout, np.random.Generator]]:
    """The rooms of a data set by name, and the source of all further randomness in each.

    Name and `seed` of the data set fix every random number of a room.

    Args:
        scene: names of `drawn` layouts, number of `generated` ones, `seed`.
        layouts: drawn rooms by name, see `layout_from`.
        clutter: what the generator draws from.
        settings: how much space people and their routes need.

    Raises:
        ConfigError: no room, one name twice, or a drawn room that is unknown or in which people cannot walk.
    """
    generated = [f"room{index:03d}" for index in range(scene["generated"])]
    names, generator = [*scene["drawn"], *generated], clutter_settings(clutter)
    if not names:
        raise ConfigError("drawn", scene["drawn"], "name a layout here or set 'generated' above 0")
    if len(set(names)) < len(names):
        raise ConfigError("drawn", scene["drawn"], "a name stands there twice or is that of a generated room")
    found = {}
    for name in names:
        chance = np.random.default_rng([scene["seed"], zlib.crc32(name.encode())])
        if name in scene["drawn"]:
            found[name] = (_drawn(name, layouts, settings), chance)
        else:
            found[name] = (cluttered_room(generator, chance), chance)
    return found


def _drawn(name: str, layouts: Mapping[str, Any], settings: SocialForceSettings) -> Layout:
    """A layout of the configuration, checked."""
    if name not in layouts:
        raise ConfigError("drawn", name, f"no such layout; there are {sorted(layouts)}")
    layout = layout_from(layouts[name], f"layouts.{name}")
    check_room(layout, ground_of(layout.occupancy()), settings, f"layouts.{name}")
    return layout


def simulated(arrangement: Arrangement, settings: SocialForceSettings) -> Scene:
    """Draw targets, let people walk."""
    rng, occupancy = arrangement.rng(), arrangement.layout.occupancy()
    targets = drawn_targets(arrangement.layout, ground_of(occupancy), settings.crowd, rng)
    people, duration_s = arrangement.pedestrians, arrangement.duration_s
    return simulate(arrangement.name, occupancy, targets, settings, people, duration_s, rng)
