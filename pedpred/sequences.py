"""Step sequences of simulated worlds that a sensor sees: what networks with a memory are trained on.

The worlds, sensors and trackers are those of `pedpred.situations`, so that both kinds of networks learn from
the same people; here every step of every track is kept, since a memory reads all of them in order.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated

from pedpred.features import FeatureTable, extract_blocks
from pedpred.settings import In, Settings, check_choice
from pedpred.simulation.worlds.sensing import SensingSettings
from pedpred.simulation.worlds.settings import WorldSettings
from pedpred.simulation.worlds.world import DRAWN_KINDS, simulate_world
from pedpred.situations import Recipe, watch_scene
from pedpred.tracking import follow


@dataclass(frozen=True)
class SequenceSets(Settings):
    """Which simulated people there are.

    Attributes:
        scenes: rows of conf/simulations, which are perceived as these say.
        worlds: kind of world -> number of worlds.
    """

    scenes: tuple[str, ...]
    worlds: Mapping[str, Annotated[int, In("[1, 1000000]")]]

    def __post_init__(self) -> None:
        super().__post_init__()
        for kind in self.worlds:
            check_choice("worlds", kind, DRAWN_KINDS)


def collect_world_steps(
    kind: str, number: int, worlds: WorldSettings, sensing: SensingSettings, recipe: Recipe
) -> Iterator[FeatureTable]:
    """Simulate a world and collect all steps of the tracks that a random sensor and tracker see.

    Args:
        kind: of the world.
        number: of the world; the same arguments give the same steps.
        worlds: ranges that it is drawn from.
        sensing: ranges of the sensor.
        recipe: protocol, inputs and trackers.
    """
    watched = watch_scene(simulate_world(kind, number, worlds), kind, sensing, recipe)
    (seen, heads), protocol = watched.sensed, recipe.made_with.protocol
    tracks = follow(seen.trajectories, "kalman", watched.kalman, recipe.standstill_mps, protocol.lost_after_s)
    return extract_blocks(seen, tracks, protocol, recipe.made_with.features, truth=heads.trajectories)
