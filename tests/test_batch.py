"""Forecasts of many instants at once equal those of a replay."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.evaluation.windows import find_windows
from pedpred.features.perception import Perception
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.batch import predictions_in_blocks
from pedpred.online.replay import predictions_at, replay_scene
from pedpred.scenes import Predictions
from pedpred.simulation.sensor import SensorSettings
from tests.worlds import walled_scene


def missed(people, rng):
    """Some detections, so that there are gaps."""
    return people.select(rng.random(len(people)) < 0.9)


def left_alone(people, rng):
    """Nobody is there for more than 2 s, twice: then regions have nobody to learn from."""
    time_s = people.time_s
    return people.select((time_s < 9) | ((time_s > 11.5) & (time_s < 16)) | (time_s > 20))


def jumping(people, rng):
    """An id jumps, in the noise of a fast sensor."""
    position = people.position + rng.normal(0, 0.03, people.position.shape)
    position[(people.track_id == people.track_id[0]) & (people.time_s > 2.5)] += 50.0
    return replace(people, position=position)


@pytest.mark.parametrize(
    ("changed", "dt_s", "long_s", "max_age_s"),
    [
        (missed, 0.4, 12, 0.5),
        (missed, 0.07, 12, 0.0),
        (left_alone, 0.1, 24, 0.5),
        (jumping, 0.02, 5, 0.5),
        (jumping, 0.003, 5, 0.5),
    ],
)
def test_all_at_once_is_a_replay(mixture, changed, dt_s, long_s, max_age_s):
    """Crowds, bursts and people who have just appeared included."""
    rng = np.random.default_rng(3)
    scene = walled_scene(rng, dt_s, detections=round(long_s / dt_s), tracks=5)
    scene = replace(scene, trajectories=changed(scene.trajectories, rng))
    predictor = OnlinePredictor.load(mixture[0], OnlineSettings(max_age_s, detection_noise_m=0.02))
    sizes = predictor.protocol
    request = find_windows(scene, Perception(predictor.filters, 0.2, SensorSettings()), sizes).request
    asked = request.asked
    slow = predictions_at(replay_scene(scene, predictor), asked.track_id, asked.time_s, 10, sizes.dt_s)
    which, parts = zip(*predictions_in_blocks(predictor, request, ""), strict=True)
    row = np.concatenate(which)
    np.testing.assert_array_equal(np.sort(row), np.arange(len(asked)))
    fast = Predictions.join(parts).select(np.argsort(row))
    assert len(slow) > 20
    for name in ("point", "path", "weight", "covariance"):
        np.testing.assert_allclose(getattr(fast, name), getattr(slow, name), atol=2e-4, err_msg=name)
