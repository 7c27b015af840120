"""Numbers of settings and their ranges: the outermost right values, and the nearest wrong ones."""

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

MANY, SHARE = 10**9, ((0.0, 1.0), (-0.001, 1.001))
SCHEDULE = {"steps": 9, "validate_every": 1, "lr": 10.0, "warmup_steps": 0, "seed": 0, "clip_norm": 1e6}
FIT = SCHEDULE | {"weight_decay": 1.0, "runs": 1000}
SPLIT = {"validation_share": 0.0, "validation_by": "scene"}
SEQUENCES = FIT | SPLIT | {"lanes": 1, "sub_sequence": 1, "longest_track": 1}
INSTANTS = FIT | {"validation_share": 0.0, "rows": 1, "shares": {"a": 1e6, "b": 0.0}}
CODED = SCHEDULE | {"latent": 3, "batch": 5}
ROWS = vars(load(RowSettings, read("situations/varied")["rows"]))
VIEWINGS = {"viewings": 1, "rows": 1, "used_share": 0.5, "thinnings": (0.1,), "noise_m": (0.0,)}
VIEWINGS |= {"thinned_noise_m": (0.0,)}
LENGTH = ((), (-0.1, 101.0))
SIMULATED = vars(SimulatedSet("room", "", 2, 60, 30, 1.0))
CORRIDOR, VIEW = WORLDS.corridor, SENSING.views["room"]
RANGES = [
    (AutoencoderSettings, CODED, "latent", (1, 100_000), (0, 100_001)),
    (AutoencoderSettings, CODED, "batch", (1, 1_000_000), (0,)),
    (AutoencoderSettings, CODED, "clip_norm", (1e6,), (0.0,)),
    (Augmentation, {}, "map_swap", *SHARE),
    (Augmentation, {}, "standing_share", *SHARE),
    (Augmentation, {}, "neighbour_dropout", *SHARE),
    (Augmentation, {}, "map_dropout", *SHARE),
    (Augmentation, {}, "velocity_noise_mps", (100.0,), (-0.1, 101.0)),
    (Augmentation, {}, "speed_scale", ((0.001, 100.0),), ((0.0, 1.0), (1.0, 101.0), (1.5, 1.2))),
    (CropSplit, {"validation_crops": 1}, "validation_share", (0.0,), (-0.1, 1.0)),
    (EvaluationSettings, {}, "bootstrap", (1,), (0,)),
    (EvaluationSettings, {}, "miss_m", (), (0.0,)),
    (SequenceSettings, SEQUENCES, "steps", (MANY,), (0, MANY + 1)),
    (SequenceSettings, SEQUENCES, "validate_every", (MANY,), (0, MANY + 1)),
    (SequenceSettings, SEQUENCES, "warmup_steps", (MANY,), (-1, MANY + 1)),
    (SequenceSettings, SEQUENCES, "seed", (), (-1,)),
    (SequenceSettings, SEQUENCES, "lr", (), (0.0, 10.1)),
    (SequenceSettings, SEQUENCES, "clip_norm", (), (0.0, 1.1e6)),
    (SequenceSettings, SEQUENCES, "weight_decay", (), (-0.1, 1.1)),
    (SequenceSettings, SEQUENCES, "runs", (), (0, 1001)),
    (Following, {"learn_noise": True}, "standstill_mps", (0.0, 100.0), (-0.1, 100.5)),
    *(
        (ForecastProtocol, {}, name, (10_000.0,), (0.0, -0.3, 10_000.5))
        for name in ("dt_s", "max_age_intervals", "lost_after_s", "truth_gap_s")
    ),
    (ForecastProtocol, {}, "horizon_steps", (1, 10_000), (0, 10_001)),
    (ForecastProtocol, {}, "min_history", (1, 10_000), (0, 10_001)),
    (InstantSettings, INSTANTS, "steps", (), (0,)),
    (InstantSettings, INSTANTS, "clip_norm", (), (0.0,)),
    (InstantSettings, INSTANTS, "validation_share", (0.0,), (-0.1, 1.0)),
    (InstantSettings, INSTANTS, "rows", (1,), (0, 1_000_001)),
    (InstantSettings, INSTANTS, "shares", (), ({"a": -1.0, "b": 2.0}, {"a": 0.0})),
    (LstmFeatures, {}, "grid_cells", (4, 1000), (0, 61, 62, 1004)),  # crops fill whole bytes
    (LstmFeatures, {}, "angular_cells", (1, 3600), (0, 3601)),
    (LstmFeatures, {}, "grid_resolution_m", (0.001, 10.0), (0.0009, 10.1)),
    (LstmFeatures, {}, "max_range_m", (100.0,), (0.0, 100.5)),
    (MetricSettings, {}, "moving_mps", (), (0.0,)),
    (MetricSettings, {}, "collision_m", (), (-0.1,)),
    (MetricSettings, {}, "miss_m", (), (math.inf,)),
    *(
        (MixtureFeatures, {}, name, (), (-4,))
        for name in ("history_steps", "neighbours", "neighbour_range_m", "beam_range_m")
    ),
    (MixtureFeatures, {}, "beams", (12,), (-4, 6)),  # patches of four
    *(
        (MixtureSettings, {}, name, (), (-2,))
        for name in ("modes", "units", "likelihood", "closest", "sharpness", "balance_m")
    ),
    (NamedSets, {}, "sets", (("simulated/main",),), ((), (3,))),
    (PlannerSettings, {}, "risk", (0.0,), (-0.1, 1.0)),
    (PlannerSettings, {}, "dt_s", (0.5,), (0.04, 0.6)),
    (PlannerSettings, {}, "horizon_s", (10.0,), (0.9, 11.0)),
    *((PlannerSettings, {}, name, *LENGTH) for name in ("first_s", "margin_m", "near_m", "wall_weight")),
    (RealShare, {}, "real_share", *SHARE),
    (Resampling, {}, "bootstrap", (1,), (0,)),
    (Resampling, {}, "seed", (0,), (-1,)),
    *((Robot, LIMITS, name, (0.05, 10.0), (0.049, 10.1)) for name in LIMITS),
    (RowSettings, ROWS, "acceleration_noise", (), ((0.0, 1.0),)),
    (RowSettings, ROWS, "position_noise_m", (), ((0.1, 101.0),)),
    (RowSettings, ROWS, "initial_speed_mps", (), ((2.0, 1.0),)),
    (RowSettings, ROWS, "newborn", (), (-1,)),
    (RowSettings, ROWS, "shift_m", (), (-0.1,)),
    (RowSettings, ROWS, "seed", (), (-1,)),
    (SequenceSets, {"scenes": ()}, "worlds", ({"room": 1}, {"room": 1_000_000}), ({"arrangement": 1}, 3)),
    *(
        (SequenceSets, {"scenes": ()}, "worlds", (), ({"room": count},))
        for count in (0, 1_000_001, True, 2.0)
    ),
    (SequenceSettings, SEQUENCES, "validation_share", (0.0,), (-0.1, 1.0)),
    (SequenceSettings, SEQUENCES, "lanes", (1,), (0, 100_001)),
    (SequenceSettings, SEQUENCES, "sub_sequence", (1,), (0, 10_001)),
    (SequenceSettings, SEQUENCES, "longest_track", (1,), (0, 1_000_001)),
    (SequenceSettings, SEQUENCES, "validation_by", (), ("step",)),
    (SimulatedSet, SIMULATED, "kind", ("corridor",), ("tunnel",)),
    (SplitSettings, SPLIT, "validation_share", (0.0,), (-0.1, 1.0)),
    (SplitSettings, SPLIT, "validation_by", ("track",), ("sequence",)),
    (ThreadSettings, {}, "threads", (1,), (0,)),
    (ViewingSettings, VIEWINGS, "viewings", (), (0,)),
    (ViewingSettings, VIEWINGS, "rows", (), (0,)),
    (ViewingSettings, VIEWINGS, "thinnings", ((0.1, 1000.0),), ((0.05,), ())),
    (ViewingSettings, VIEWINGS, "noise_m", ((0.0, 100.0),), ((-0.1,),)),
    (ViewingSettings, VIEWINGS, "thinned_noise_m", (), ((101.0,),)),
    (type(CORRIDOR), vars(CORRIDOR), "width_m", ((2.0, 2.0),), ((3.0, 2.0),)),
    (type(CORRIDOR), vars(CORRIDOR), "forms", (), ({},)),
    (type(VIEW), vars(VIEW), "window_m", (), ((0.0, 1.0),)),
]


@pytest.mark.parametrize(("kind", "usual", "name", "right", "wrong"), RANGES)
def test_a_number_is_in_its_range_or_refused(kind, usual, name, right, wrong):
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
