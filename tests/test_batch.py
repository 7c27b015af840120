"""Forecasts of many instants at once equal those of a replay."""

import dataclasses

import numpy as np
import pytest

from pedpred.evaluation.windows import find_windows
from pedpred.features.perception import Perception
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.batch import predictions_in_blocks
from pedpred.online.replay import predictions_at, replay_scene
from pedpred.scenes import Predictions, Scene
from pedpred.simulation.sensor import SensorSettings
from tests.worlds import walled_scene


def both(scene: Scene, predictor: OnlinePredictor):
    sizes = predictor.protocol
    request = find_windows(scene, Perception(predictor.filters, 0.2, SensorSettings()), sizes).request
    asked = request.asked
    slow = predictions_at(replay_scene(scene, predictor), asked.track_id, asked.time_s, 10, sizes.dt_s)
    which, parts = zip(*predictions_in_blocks(predictor, request, ""), strict=True)
    row = np.concatenate(which)
    np.testing.assert_array_equal(np.sort(row), np.arange(len(asked)))
    return slow, Predictions.join(parts).select(np.argsort(row))


@pytest.mark.parametrize(("dt_s", "max_age_s"), [(0.4, 0.5), (0.1, 0.5), (0.07, 0.0)])
def test_all_at_once_is_a_replay(mixture, dt_s, max_age_s):
    """Gaps, crowds and people who have just appeared included."""
    rng = np.random.default_rng(3)
    scene = walled_scene(rng, dt_s, detections=round(12 / dt_s), tracks=5)
    seen = rng.random(len(scene.trajectories)) < 0.9
    scene = dataclasses.replace(scene, trajectories=scene.trajectories.select(seen))
    settings = OnlineSettings(max_age_s, detection_noise_m=0.02)
    slow, fast = both(scene, OnlinePredictor.load(mixture[0], settings))
    assert len(slow) > 20
    for name in ("point", "path", "weight", "covariance"):
        np.testing.assert_allclose(getattr(fast, name), getattr(slow, name), atol=2e-4, err_msg=name)


def test_a_gap_without_anybody_is_the_same_in_a_replay(mixture):
    """After more than 2 s without a detection, regions have nobody to learn from, in both."""
    rng = np.random.default_rng(4)
    scene = walled_scene(rng, 0.1, detections=240, tracks=5)
    time_s = scene.trajectories.time_s
    there = (time_s < 9) | ((time_s > 11.5) & (time_s < 16)) | (time_s > 20)
    scene = dataclasses.replace(scene, trajectories=scene.trajectories.select(there))
    slow, fast = both(scene, OnlinePredictor.load(mixture[0], OnlineSettings(0.5, detection_noise_m=0.02)))
    assert len(slow) > 20
    np.testing.assert_allclose(fast.covariance, slow.covariance, atol=2e-4)


@pytest.mark.parametrize("dt_s", [0.02, 0.003])
def test_fast_frames_are_the_same_in_a_replay(mixture, dt_s):
    """Bursts and ids that jump included."""
    rng = np.random.default_rng(5)
    scene = walled_scene(rng, dt_s, detections=round(5 / dt_s), tracks=3)
    trajectories = scene.trajectories
    position = trajectories.position + rng.normal(0, 0.03, trajectories.position.shape)
    position[(trajectories.track_id == trajectories.track_id[0]) & (trajectories.time_s > 2.5)] += 50.0
    scene = dataclasses.replace(scene, trajectories=dataclasses.replace(trajectories, position=position))
    slow, fast = both(scene, OnlinePredictor.load(mixture[0], OnlineSettings(0.5, detection_noise_m=0.03)))
    assert len(slow) > 20
    for name in ("point", "path", "weight", "covariance"):
        np.testing.assert_allclose(getattr(fast, name), getattr(slow, name), atol=2e-4, err_msg=name)
