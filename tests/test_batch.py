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


@pytest.mark.parametrize(
    ("dt_s", "max_age_s", "gap_s"), [(0.4, 0.5, 0.0), (0.1, 0.5, 2.5), (0.07, 0.0, 0.0), (0.003, 0.5, 0.0)]
)
def test_all_at_once_is_a_replay(mixture, dt_s, max_age_s, gap_s):
    """Lost detections, people who have just appeared, bursts, an id that jumps and a time without anybody."""
    rng = np.random.default_rng(3)
    scene = walled_scene(rng, dt_s, detections=round(min(12.0, 1500 * dt_s) / dt_s), tracks=5)
    people = scene.trajectories
    jumps = (people.track_id == people.track_id[0]) & (people.time_s > 2.5)
    position = people.position + jumps[:, None] * 50.0
    seen = rng.random(len(people)) < 0.9
    seen &= ~((people.time_s > 6.0) & (people.time_s < 6.0 + gap_s))
    people = dataclasses.replace(people, position=position).select(seen)
    settings = OnlineSettings(max_age_s, detection_noise_m=0.02)
    scene = dataclasses.replace(scene, trajectories=people)
    slow, fast = both(scene, OnlinePredictor.load(mixture[0], settings))
    assert len(slow) > 10
    for name in ("point", "path", "weight", "covariance"):
        np.testing.assert_allclose(getattr(fast, name), getattr(slow, name), atol=2e-4, err_msg=name)
