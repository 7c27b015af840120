"""Step sequences of sensed worlds: the same worlds and sensors as the situations, and only what was seen."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.config import plain, read_params
from pedpred.models.features import RowFormat
from pedpred.rows.sampling import RowSampling, RowSettings
from pedpred.rows.simulated import steps_of_world
from pedpred.settings import load
from pedpred.simulation.worlds.world import simulate_world
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


def test_targets_are_the_true_paths_whatever_the_sensor_adds(education):
    """Somebody seen with 10 cm of noise goes where the same person goes who is seen exactly."""
    quiet = {
        "noisy_share": 0.0,
        "sway_share": 0.0,
        "drift_share": 0.0,
        "drop_out_share": 0.0,
        "late_share": 0.0,
    }
    quiet |= {"jitter_share": 0.0, "quantum_share": 0.0, "switch_share": 0.0, "rates_hz": (10.0,)}
    blocks = steps(education, "lone", **quiet)
    scene = simulate_world("lone", 0, education[0])
    known = {
        (int(track), round(float(now), 1)): place
        for track, now, place in zip(
            scene.trajectories.track_id, scene.trajectories.time_s, scene.trajectories.position, strict=True
        )
    }
    position, heading = column(blocks, "position"), column(blocks, "heading_rad")
    future, ahead = column(blocks, "future").astype(float), column(blocks, "future_steps")
    checked = 0
    for row in np.flatnonzero(ahead == 10)[::7]:
        turn = np.array(
            [[np.cos(heading[row]), -np.sin(heading[row])], [np.sin(heading[row]), np.cos(heading[row])]]
        )
        end = position[row] + 0.3 * (future[row] @ turn.T).sum(axis=0)
        now = float(column(blocks, "time_s")[row]) + 3.0
        near = [place for (_, at), place in known.items() if abs(at - now) < 0.051]
        assert min(np.linalg.norm(np.array(near) - end, axis=1)) < 0.15
        checked += 1
    assert checked > 5
