"""The arrangements of a simulated data set: which rooms, how long, and with which random numbers."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.errors import ConfigError
from pedpred.scenes import Scene
from pedpred.simulation.clutter import ClutterSettings, clutter_settings, cluttered_room
from pedpred.simulation.ground import ground_of
from pedpred.simulation.layouts import Layout, layout_from
from pedpred.simulation.places import drawn_targets
from pedpred.simulation.settings import SocialForceSettings
from pedpred.simulation.simulator import simulate


@dataclass(frozen=True)
class Arrangement:
    """One room to be simulated.

    Attributes:
        name: unique within its data set; also the folder's name.
        layout: a drawn room; None = the generator makes one from the seed.
        clutter: what the generator draws from.
        seed: of the data set. Together with the name it fixes every random number.
        pedestrians: how many walk there.
        duration_s: recorded time.
    """

    name: str
    layout: Layout | None
    clutter: ClutterSettings
    seed: int
    pedestrians: int
    duration_s: float

    def rng(self) -> np.random.Generator:
        """The same numbers wherever and in whichever order arrangements are simulated."""
        return np.random.default_rng([self.seed, zlib.crc32(self.name.encode())])


def arrangements(
    scene: Mapping[str, Any], layouts: Mapping[str, Any], clutter: Mapping[str, Any]
) -> list[Arrangement]:
    """What a configuration `scenes.<key>` of source `simulation` asks for; all share its hours equally.

    Raises:
        ConfigError: another source, an unknown layout, nothing to simulate.
    """
    if scene["source"] != "simulation":
        raise ConfigError("source", scene["source"], "only scenes of source 'simulation' can be simulated")
    unknown = set(scene["drawn"]) - set(layouts)
    if unknown:
        raise ConfigError("drawn", min(unknown), f"no such layout; there are {sorted(layouts)}")
    rooms: dict[str, Layout | None] = {
        name: layout_from(layouts[name], f"layouts.{name}") for name in scene["drawn"]
    }
    rooms.update({f"room{index:03d}": None for index in range(scene["generated"])})
    if not rooms:
        raise ConfigError("drawn", scene["drawn"], "name a layout here or set 'generated' above 0")
    duration_s, settings = 3600.0 * scene["hours"] / len(rooms), clutter_settings(clutter)
    return [
        Arrangement(name, room, settings, scene["seed"], scene["pedestrians"], duration_s)
        for name, room in rooms.items()
    ]


def simulated(arrangement: Arrangement, settings: SocialForceSettings) -> Scene:
    """Build the room, draw targets, let people walk."""
    rng = arrangement.rng()
    layout = arrangement.layout or cluttered_room(arrangement.clutter, rng)
    occupancy = layout.occupancy()
    targets = drawn_targets(layout, ground_of(occupancy), settings.crowd, rng)
    people, duration_s = arrangement.pedestrians, arrangement.duration_s
    return simulate(arrangement.name, occupancy, targets, settings, people, duration_s, rng)
