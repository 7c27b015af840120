"""Every detection counts: the windows of regular, irregular, sparse and empty recordings."""

import dataclasses

import numpy as np
import pytest

from pedpred.baselines.registry import BASELINES
from pedpred.baselines.social_force import people_present
from pedpred.errors import ValueRuleError
from pedpred.evaluation import EvaluationSettings, measure
from pedpred.evaluation.windows import find_windows, request_about
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.online import OnlinePredictor
from pedpred.online.assessment import assess
from pedpred.scenes import Scene, Trajectories
from pedpred.simulation.sensor import SensorSettings
from tests.exported import TRACKER, forecaster_of
from tests.simulated import SETTINGS as WALKING
from tests.worlds import empty_map, jittered

KALMAN = Perception(TRACKER, 0.2)
SETTINGS = EvaluationSettings(bootstrap=10)
CAUSAL, NONCAUSAL = ForecastProtocol(), ForecastProtocol(noncausal=True)


def walked(dt_s, seconds=30.0, people=4):
    """People who walk straight and turn back, seen all the time."""
    time_s = np.arange(0, seconds, dt_s)
    there = np.stack([3 * np.sin(time_s / 5), 0.3 * time_s], axis=-1)
    position = np.concatenate([there + np.array([k, 0.5 * k]) for k in range(people)])
    track = np.repeat(np.arange(people), len(time_s))
    return Scene("walk", Trajectories(np.tile(time_s, people), track, position), empty_map(), dt_s)


def windows_of(scene, sizes=CAUSAL, how=KALMAN):
    return find_windows(scene, how, sizes, WALKING)


def asked(scene, sizes=CAUSAL, how=KALMAN):
    return windows_of(scene, sizes, how).request


def without(scene, gone):
    return dataclasses.replace(scene, trajectories=scene.trajectories.select(~gone))


def test_jittered_detections_keep_their_windows(model):
    folder, network, encoder = model
    on_clock = walked(0.3)
    rare = walked(1 / 2.4)
    noisy = jittered(rare, 0.02, np.random.default_rng(0), "detection")
    for scene in (on_clock, rare, noisy):
        windows = windows_of(scene)
        request = windows.request
        seconds_of_windows = len(request.rows) * scene.detection_dt_s / 4  # of each person
        assert seconds_of_windows == pytest.approx(27.0 - 3 * scene.detection_dt_s, abs=scene.detection_dt_s)
        pipeline = measure(windows, {"network": forecaster_of(network, encoder)}, SETTINGS)
        robot = OnlinePredictor.load(folder)
        command = assess(scene, robot, SETTINGS)
        assert len(command["network"].track) == len(pipeline["network"].track) == len(request.rows)
        assert pipeline["network"].without_truth == 0
    assert len(asked(noisy).rows) == pytest.approx(len(asked(rare).rows), rel=0.01)


def test_a_recording_slower_than_truth_allows_is_refused():
    with pytest.raises(ValueRuleError):
        asked(walked(0.8))
    assert len(asked(walked(0.8), ForecastProtocol(truth_gap_s=1.0)).rows) > 50


def test_everybody_moves_along_once_at_every_instant():
    """With a time stamp for each detection, all others are extrapolated, not forgotten."""
    scene = walked(0.4)
    request = asked(jittered(scene, 0.02, np.random.default_rng(1), "detection"))
    people, answers = people_present(request)
    seen, own = request.asked, np.unique(request.asked.time_s)
    for name in ("track_id", "time_s", "position"):
        np.testing.assert_array_equal(getattr(people, name)[answers], getattr(seen, name))
    assert len(people.track_id) == len({*zip(people.track_id, people.time_s, strict=True)}) == 4 * len(own)
    plain = asked(scene)
    forecast = BASELINES["social_force"]()
    apart = np.linalg.norm(forecast(request).point[:, 0] - seen.position, axis=-1)
    usual = np.linalg.norm(forecast(plain).point[:, 0] - plain.asked.position, axis=-1)
    assert apart.mean() == pytest.approx(usual.mean(), rel=0.2)


@pytest.mark.parametrize("sizes", [CAUSAL, NONCAUSAL])
@pytest.mark.parametrize("sensor", [SensorSettings(), SensorSettings(position_noise_m=0.1, switch_share=0.5)])
def test_an_empty_recording_is_perceived(sizes, sensor):
    scene = walked(0.4)
    nobody = without(scene, np.ones(len(scene.trajectories), bool))
    how = Perception(TRACKER, 0.2, sensor)
    request = request_about(nobody, how, sizes, nobody.trajectories, memory=True)
    assert len(request.table) == len(request.steps) == len(request.rows) == 0
