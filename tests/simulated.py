"""Small simulated places for the tests; the shipped configuration, a few seconds each."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from pedpred.settings import load, load_together
from pedpred.simulation.arrangements import arrangements, parse_layouts, simulate_arrangement
from pedpred.simulation.clutter import ClutterSettings
from pedpred.simulation.layouts import Layout, TargetPool, layout_from
from pedpred.simulation.settings import SimulationSettings, social_force_settings
from pedpred.simulation.worlds import DRAWN_KINDS, SensingSettings, WorldSettings
from stages.sets import SetTracking

CONF = Path(__file__).parents[1] / "conf"


def read(name):
    return yaml.safe_load((CONF / f"{name}.yaml").read_text())


SOCIAL_FORCE = read("social_forces/walking")["helbing1995"]
SETTINGS = social_force_settings(SOCIAL_FORCE)
CLUTTER = read("clutter/rooms")
WORLDS = load(WorldSettings, read("worlds/varied"))
SENSING = load(SensingSettings, read("sensing/varied"))
USE = {
    "social_force": "helbing1995",
    "tracker": "truth",
    "sensor": "perfect",
    "phase_offsets": 1,
    "variants": [],
}
DRAWN = {path.stem: yaml.safe_load(path.read_text()) for path in sorted((CONF / "layouts").glob("*.yaml"))}


def with_field(path, value):
    """The plain settings with one field changed."""
    group, name = path.split(".")
    return {**SOCIAL_FORCE, group: {**SOCIAL_FORCE[group], name: value}}


QUIET = social_force_settings(with_field("clock.noise_mps2", 0.0))


def drawn(name):
    return layout_from(DRAWN[name], name)


def data_set_of(row):
    """The simulated set of a plain row of `conf/simulations`."""
    return load_together([SimulationSettings, SetTracking], row)[0]


def asked(row, layouts=DRAWN):
    """The arrangements of a plain row of `conf/simulations`, which may lack `SetTracking`."""
    data_set = data_set_of(USE | row)
    drawn = parse_layouts(layouts, data_set.drawn, SETTINGS)
    return arrangements(data_set, drawn, load(ClutterSettings, CLUTTER), SETTINGS)


def short(seconds, pedestrians=20, **changes):
    """A data set of one drawn layout, overridden by `changes`."""
    scene = {"drawn": ["columns"], "generated": 0, "seed": 7}
    scene.update(changes, pedestrians=pedestrians)
    rooms = len(scene["drawn"]) + scene["generated"]
    return asked({**scene, "hours": rooms * seconds / 3600.0})


def scene_of(arrangement, settings=SETTINGS):
    return simulate_arrangement(arrangement, settings)


def pool(*places):
    return TargetPool(np.array(places, dtype=float), np.arange(len(places)))


EMPTY_ROOM = Layout((12.0, 8.0))


def short_worlds(duration_s, warm_up_s=WORLDS.warm_up_s):
    """The settings of worlds with another recorded time."""
    kinds = {kind: replace(getattr(WORLDS, kind), duration_s=duration_s) for kind in DRAWN_KINDS}
    return replace(WORLDS, warm_up_s=warm_up_s, **kinds)
