"""Where episodes take place: in a recording, or in simulated worlds, whose people may see the robot."""

from __future__ import annotations

import copy
import functools
import zlib
from collections import Counter
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.driving.crowds import ReactiveCrowd, with_robot
from pedpred.driving.episodes import DriveSettings, Episode, NobodyMetError, Place, draw_episode
from pedpred.driving.sensor import Faults
from pedpred.errors import InputError, ValueRuleError
from pedpred.files import read_yaml
from pedpred.scenes import Scene
from pedpred.settings import load
from pedpred.simulation.worlds import WorldSettings
from pedpred.simulation.worlds.world import RECORD_S, draw_visited_world, record_walking

TRAINED_ON = (
    Path(__file__).with_name("trained_on.yaml"),
    Path(__file__).parents[2] / "conf/worlds/varied.yaml",
)
"""Ranges of the worlds that networks learn from: in the installed package, and in the checkout."""
CHANGES = Path(__file__).with_name("worlds.yaml")
_BEFORE_END_S = 35.0  # an episode begins so long before people stop coming
_DRAWS = 50  # worlds tried for an episode
_TRIES = 200  # ways tried in one

KINDS = ("corridor", "room", "square")
REACTIONS = ("react", "ignore")


@functools.cache
def ranges() -> WorldSettings:
    """What worlds are drawn from: the ranges of training, with the changes in the file beside this module.

    Raises:
        InputError: a file is missing or damaged.
    """
    trained_on = next((path for path in TRAINED_ON if path.is_file()), TRAINED_ON[-1])
    usual, changes = (read_yaml(path, partial(InputError, path, "file")) for path in (trained_on, CHANGES))
    settings: WorldSettings = load(WorldSettings, _changed(usual, changes))
    return settings


def _changed(usual: Any, changes: Any) -> Any:
    """Values, or those that replace them, at any depth."""
    if not isinstance(usual, dict) or not isinstance(changes, dict):
        return changes
    return usual | {name: _changed(usual.get(name), value) for name, value in changes.items()}


class Recording:
    """All episodes take place in one scene, among its recorded people."""

    def __init__(self, scene: Scene):
        self.name, self._scene = scene.name, scene
        self._place: Place | None = None

    def digest(self) -> bytes:
        """Bytes that identify it."""
        people, ground = self._scene.trajectories, self._scene.occupancy
        arrays = people.time_s, people.track_id, people.position, ground.occupied, ground.origin
        about = repr((self.name, ground.resolution_m)).encode()
        return b"".join(np.ascontiguousarray(values).tobytes() for values in arrays) + about

    def draw(self, number: int, settings: DriveSettings) -> tuple[Place, Episode]:
        """Draw an episode from (seed, number) alone."""
        if self._place is None:
            self._place = Place.of(self._scene, settings.planner.dt_s)
        return self._place, draw_episode(self._place, number, settings)


@dataclass(frozen=True)
class Worlds:
    """Every episode takes place in a world of its own, in which `walk` moves people as in training worlds.

    Attributes:
        kind: one of `KINDS`.
        react: whether people see the robot as one of them.
    """

    kind: str
    react: bool

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueRuleError("kind", self.kind, f"it must be one of {', '.join(KINDS)}")

    @property
    def name(self) -> str:
        """For tables."""
        return f"{self.kind}_{REACTIONS[0] if self.react else REACTIONS[1]}"

    def digest(self) -> bytes:
        """Bytes that identify it."""
        return f"{self.name} {ranges()}".encode()

    def draw(self, number: int, settings: DriveSettings) -> tuple[Place, Episode]:
        """Draw a world and an episode in it from (seed, number) alone.

        People are the same, until they meet the robot, whether they react or not.

        Raises:
            NobodyMetError: in no world that was tried a robot meets anybody.
        """
        refused, dt_s, own = Counter[str](), settings.planner.dt_s, getattr(ranges(), self.kind)
        for attempt in range(_DRAWS):
            key = [settings.seed, zlib.crc32(self.kind.encode()), number, attempt]
            scene, crowd = draw_world(self.kind, key, settings.robot.radius_m, dt_s)
            try:
                place = Place.of(scene, dt_s)
                episode = draw_episode(place, number, settings, _TRIES, own.duration_s - _BEFORE_END_S)
            except NobodyMetError as cause:
                refused += cause.refused
                continue
            except ValueRuleError as cause:  # as where nobody walks
                refused[cause.rule] += 1
                continue
            if self.react:
                first_s = ranges().warm_up_s + RECORD_S + place.people.start_s
                crowd.advance(round((first_s + episode.tick * dt_s) / dt_s))
                faults = Faults.draw(episode.ticks, len(crowd.track_id), np.random.default_rng([*key, 1]))
                episode = replace(episode, people=crowd, faults=faults)
            return place, episode
        raise NobodyMetError("world", self.kind, settings, refused, f"in {_DRAWS} worlds ")


Places = Recording | Worlds
"""Where episodes take place."""


def draw_world(kind: str, key: list[int], radius_m: float, dt_s: float) -> tuple[Scene, ReactiveCrowd]:
    """Draw a world: recorded without a robot, and its people before they come.

    Args:
        kind: one of `KINDS`.
        key: seeds of the random numbers.
        radius_m: of the robot that they will meet.
        dt_s: time between two instants of its clock, s.
    """
    rng, settings = np.random.default_rng(key), ranges()
    occupancy, world = draw_visited_world(kind, settings, rng)
    crowd = ReactiveCrowd(with_robot(world, radius_m), copy.deepcopy(rng), dt_s)
    people = record_walking(world, settings.warm_up_s, getattr(settings, kind).duration_s, rng)
    return Scene(f"{kind}_{'_'.join(map(str, key[2:]))}", people, occupancy, RECORD_S), crowd
