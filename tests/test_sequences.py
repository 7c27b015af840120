"""Step sequences of sensed worlds: the same worlds and sensors as the situations, and only what was seen."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.config import plain, read_params
from pedpred.models.features import RowFormat
from pedpred.rows.sampling import RowSampling, RowSettings
from pedpred.rows.simulated import steps_of_world
from pedpred.settings import load
from stages.perception import features_of, protocol_of
from stages.worlds import worlds_of
from tests.conftest import ROOT

PARAMS = read_params(ROOT)
SHORT_S = 12.0


@pytest.fixture(scope="module")
def education():
    """Short worlds, sensors, and how rows are made, as configured."""
    worlds, sensing = worlds_of(PARAMS)
    for kind in ("corridor", "lone"):
        worlds = replace(worlds, **{kind: replace(getattr(worlds, kind), duration_s=SHORT_S)})
    protocol, how = protocol_of(PARAMS)
    made_with = RowFormat(replace(protocol, noncausal=False), "lstm", features_of(PARAMS, "lstm"))
    sampling = RowSampling(load(RowSettings, plain(PARAMS.situations.rows)), made_with, how.standstill_mps)
    return worlds, sensing, sampling


def steps(education, kind="corridor", number=0, **changes):
    worlds, sensing, sampling = education
    return list(steps_of_world(kind, number, worlds, replace(sensing, **changes), sampling))


def column(blocks, name):
    return np.concatenate([getattr(block, name) for block in blocks])


@pytest.mark.parametrize("kind", ["corridor", "lone"])
def test_the_same_world_gives_the_same_steps(education, kind):
    first, second = steps(education, kind), steps(education, kind)
    for name in ("track_id", "time_s", "position", "velocity", "future"):
        assert column(first, name).tobytes() == column(second, name).tobytes()


def test_steps_of_a_track_follow_the_clock_of_the_protocol(education):
    blocks = steps(education)
    track, time_s = column(blocks, "track_id"), column(blocks, "time_s")
    within = np.diff(track) == 0
    dt_s = education[2].row_format.protocol.dt_s
    assert within.sum() > 100
    assert np.allclose(np.diff(time_s)[within] / dt_s, np.round(np.diff(time_s)[within] / dt_s), atol=1e-6)
