"""Numbers of settings: the outermost right values, and the nearest wrong ones."""

import math
from typing import Annotated, get_args

import pytest

from pedpred.datasets.crops import CropSplit
from pedpred.datasets.splits import SplitSettings
from pedpred.driving.planner import PlannerSettings
from pedpred.driving.robot import Robot
from pedpred.evaluation import EvaluationSettings, MetricSettings, Resampling
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Following
from pedpred.models.lstm.features import LstmFeatures
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.models.mixture.network import MixtureSettings
from pedpred.rows.recorded import ViewingSettings
from pedpred.rows.sampling import RowSettings
from pedpred.rows.simulated import SequenceSets, SimulatedSet
from pedpred.settings import In, Range, load
from pedpred.simulation.worlds.drawing import LogUniform, Uniform
from pedpred.training import AutoencoderSettings
from pedpred.training.augmentation import Augmentation
from pedpred.training.distributed import ThreadSettings
from pedpred.training.instants import InstantSettings
from pedpred.training.sequences import SequenceSettings
from pedpred.training.sets import NamedSets, RealShare
from tests.by_hand.robots import LIMITS
from tests.refused import refused
from tests.simulated import SENSING, WORLDS, read

SCHEDULE = {"steps": 9, "validate_every": 1, "lr": 10.0, "warmup_steps": 0, "seed": 0, "clip_norm": 1e6}
FIT = SCHEDULE | {"weight_decay": 1.0, "runs": 1000}
SPLIT = {"validation_share": 0.0, "validation_by": "scene"}
SEQUENCES = FIT | SPLIT | {"lanes": 1, "sub_sequence": 1, "longest_track": 1}
INSTANTS = FIT | {"validation_share": 0.0, "rows": 1, "shares": {"a": 1e6, "b": 0.0}}
CODED = SCHEDULE | {"latent": 3, "batch": 5}
ROWS = vars(load(RowSettings, read("situations/varied")["rows"]))
VIEWINGS = {"viewings": 1, "rows": 1, "used_share": 0.5, "thinnings": (0.1,), "noise_m": (0.0,)}
VIEWINGS |= {"thinned_noise_m": (0.0,)}
CORRIDOR, VIEW = WORLDS.corridor, SENSING.views["room"]
NUMBERS = [  # whole where the lower end is
    (AutoencoderSettings, CODED, "latent", "[1, 100000]"),
    (AutoencoderSettings, CODED, "batch", "[1, 1000000]"),
    (AutoencoderSettings, CODED, "clip_norm", "(0.0, 1e6]"),
    (Augmentation, {}, "map_swap standing_share neighbour_dropout map_dropout", "[0.0, 1]"),
    (Augmentation, {}, "velocity_noise_mps", "[0.0, 100]"),
    (CropSplit, {"validation_crops": 1}, "validation_share", "[0.0, 1)"),
    (EvaluationSettings, {}, "bootstrap", "[1, 100000]"),
    (Following, {"learn_noise": True}, "standstill_mps", "[0.0, 100]"),
    (ForecastProtocol, {}, "dt_s max_age_intervals lost_after_s truth_gap_s", "(0.0, 10000]"),
    (ForecastProtocol, {}, "horizon_steps min_history", "[1, 10000]"),
    (InstantSettings, INSTANTS, "validation_share", "[0.0, 1)"),
    (InstantSettings, INSTANTS, "rows", "[1, 1000000]"),
    (LstmFeatures, {}, "angular_cells", "[1, 3600]"),
    (LstmFeatures, {}, "grid_resolution_m", "[0.001, 10]"),
    (LstmFeatures, {}, "max_range_m", "(0.0, 100]"),
    (MetricSettings, {}, "moving_mps collision_m miss_m", "(0.0, 1e6]"),
    (MixtureFeatures, {}, "history_steps", "[1, 100]"),
    (MixtureFeatures, {}, "neighbours", "[1, 1000]"),
    (MixtureFeatures, {}, "neighbour_range_m beam_range_m", "(0.0, 100]"),
    (MixtureSettings, {"mirrored": False}, "modes", "[1, 1000]"),
    (MixtureSettings, {}, "units", "[1, 65536]"),
    (MixtureSettings, {}, "likelihood closest", "[0.0, 1e6]"),
    (MixtureSettings, {}, "sharpness balance_m", "(0.0, 1e6]"),
    (PlannerSettings, {}, "risk", "[0.0, 1)"),
    (PlannerSettings, {}, "dt_s", "[0.05, 0.5]"),
    (PlannerSettings, {}, "horizon_s", "[1.0, 10]"),
    (PlannerSettings, {}, "first_s margin_m near_m wall_weight", "[0.0, 100]"),
    (RealShare, {}, "real_share", "[0.0, 1]"),
    (Resampling, {}, "seed", "[0, 4294967295]"),
    (Robot, LIMITS, " ".join(LIMITS), "[0.05, 10]"),
    (RowSettings, ROWS, "newborn", "[0, 1000]"),
    (RowSettings, ROWS, "shift_m", "[0.0, 1000]"),
    (SequenceSettings, SEQUENCES, "steps validate_every", "[1, 1000000000]"),
    (SequenceSettings, SEQUENCES, "warmup_steps", "[0, 1000000000]"),
    (SequenceSettings, SEQUENCES, "lr", "(0.0, 10]"),
    (SequenceSettings, SEQUENCES, "clip_norm", "(0.0, 1e6]"),
    (SequenceSettings, SEQUENCES, "weight_decay", "[0.0, 1]"),
    (SequenceSettings, SEQUENCES, "runs", "[1, 1000]"),
    (SequenceSettings, SEQUENCES, "lanes", "[1, 100000]"),
    (SequenceSettings, SEQUENCES, "sub_sequence", "[1, 10000]"),
    (SequenceSettings, SEQUENCES, "longest_track", "[1, 1000000]"),
    (SplitSettings, SPLIT, "validation_share", "[0.0, 1)"),
    (ThreadSettings, {}, "threads", "[1, 1024]"),
    (ViewingSettings, VIEWINGS, "viewings rows", "[1, 1000000]"),
]


@pytest.mark.parametrize(("kind", "usual", "names", "interval"), NUMBERS)
def test_numbers_are_within_their_intervals(kind, usual, names, interval):
    low, high = interval[1:-1].split(", ")
    kind_of = float if "." in low else int
    low, high = kind_of(low), kind_of(high)
    off = 1e-9 * high if kind_of is float else 1
    right = [low if interval[0] == "[" else low + off, high if interval[-1] == "]" else high - off]
    for name in names.split():
        for value in right:
            assert getattr(kind(**usual | {name: value}), name) == value
        for value in (right[0] - off, right[1] + off, math.inf, math.nan):
            with refused(name):
                kind(**usual | {name: value})


OTHERS = [
    (Augmentation, {}, "speed_scale", ((0.001, 100.0),), ((0.0, 1.0), (1.0, 101.0), (1.5, 1.2))),
    (InstantSettings, INSTANTS, "shares", (), ({"a": -1.0, "b": 2.0}, {"a": 0.0})),
    (LstmFeatures, {}, "grid_cells", (4, 1000), (0, 61, 62, 1004)),  # crops fill whole bytes
    (MixtureFeatures, {}, "beams", (12,), (-4, 6)),  # patches of four
    (NamedSets, {}, "sets", (("simulated/main",),), ((), (3,))),
    (RowSettings, ROWS, "acceleration_noise", (), ((0.0, 1.0),)),
    (RowSettings, ROWS, "position_noise_m", (), ((0.1, 101.0),)),
    (RowSettings, ROWS, "initial_speed_mps", (), ((2.0, 1.0),)),
    (SequenceSets, {"scenes": ()}, "worlds", ({"room": 1}, {"room": 1_000_000}), ({"arrangement": 1}, 3)),
    (SequenceSets, {"scenes": ()}, "worlds", (), [{"room": count} for count in (0, 1_000_001, True, 2.0)]),
    (SimulatedSet, vars(SimulatedSet("room", "", 2, 60, 30, 1.0)), "kind", ("corridor",), ("tunnel",)),
    (SplitSettings, SPLIT, "validation_by", ("track",), ("sequence",)),
    (ViewingSettings, VIEWINGS, "thinnings", ((0.1, 1000.0),), ((0.05,), ())),
    (ViewingSettings, VIEWINGS, "noise_m", ((0.0, 100.0),), ((-0.1,),)),
    (ViewingSettings, VIEWINGS, "thinned_noise_m", (), ((101.0,),)),
    (type(CORRIDOR), vars(CORRIDOR), "width_m", ((2.0, 2.0),), ((3.0, 2.0),)),
    (type(CORRIDOR), vars(CORRIDOR), "forms", (), ({},)),
    (type(VIEW), vars(VIEW), "window_m", (), ((0.0, 1.0),)),
]


@pytest.mark.parametrize(("kind", "usual", "name", "right", "wrong"), OTHERS)
def test_values_follow_the_rule_of_their_field(kind, usual, name, right, wrong):
    for value in right:
        assert getattr(kind(**usual | {name: value}), name) == value
    for value in wrong:
        with refused(name):
            kind(**usual | {name: value})


def test_rules_of_one_interval_stay_apart():
    """Some versions of Python answer equal annotations with the first of them."""
    kinds = (In, Uniform, LogUniform)
    hints = [Annotated[Range, kind("(0, 1000]")] for kind in kinds]
    assert tuple(type(get_args(hint)[1]) for hint in hints) == kinds
