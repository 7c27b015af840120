"""Recorded people, replayed online frame by frame, get the forecasts that the offline pipeline makes."""

import dataclasses

import numpy as np
import pytest

from pedpred.evaluation.windows import request_about
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.online import OnlinePredictor
from pedpred.online.caution import NEWBORN, YOUNG_S
from pedpred.online.replay import predictions_at, replay_scene
from pedpred.tracking import KalmanBank
from tests.exported import TRACKER, as_offline, forecaster_of
from tests.worlds import EXCERPT, jittered, recorded, walled_scene


def everything_asked(scene, kind):
    """A request for a forecast of every detection, window or not."""
    how = Perception(KalmanBank.around(TRACKER) if kind == "kalman" else None, 0.2)
    return request_about(scene, how, ForecastProtocol(), scene.trajectories, memory=True)


def assert_a_replay_agrees(scene, kind, model):
    """At every detection: paths and covariances; a robot is cautious at the first ones (`online.caution`)."""
    folder, network, encoder = model
    request = everything_asked(scene, kind)
    offline = forecaster_of(network, encoder, trust=True, local_errors=True)(request)
    robot = OnlinePredictor.load(folder, as_offline(request.sizes, scene.detection_dt_s))
    forecasts = replay_scene(scene, robot, kind == "truth")
    online = predictions_at(forecasts, request.table.track_id, request.table.time_s, 10, request.sizes.dt_s)
    assert len(request.table) == len(scene.trajectories)
    np.testing.assert_allclose(online.weight, offline.weight, atol=1e-4)
    table, row = request.table, np.arange(len(request.table))
    age_s = table.time_s - table.time_s[np.maximum.accumulate(np.where(table.step == 0, row, 0))]
    cautious = not network.state_shapes and kind == "kalman"
    old = row[(table.step >= NEWBORN) & (age_s > YOUNG_S - 1e-3)] if cautious else row
    for name in ("point", "path", "covariance"):
        own, other = (getattr(predictions, name)[old] for predictions in (online, offline))
        np.testing.assert_allclose(own, other, atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("of", ["model", "mixture"])
@pytest.mark.parametrize(
    ("kind", "dt_s", "off_s"),
    [("kalman", 0.1, 0.02), ("kalman", 1 / 2.4, 0.0), ("kalman", 0.7, 0.0), ("truth", 0.3, 0.0)],
)
def test_a_replay_gives_the_offline_forecasts(request, of, kind, dt_s, off_s):
    """At every detection, on the clock of the network or between its steps, often, rarely or irregularly."""
    scene = walled_scene(np.random.default_rng(1), dt_s, kind == "truth", detections=int(10 / dt_s) + 9)
    scene = jittered(scene, off_s, np.random.default_rng(3), "detection") if off_s else scene
    assert_a_replay_agrees(scene, kind, request.getfixturevalue(of))


@pytest.mark.parametrize("place", [EXCERPT, "eth"])
def test_real_recordings_give_the_offline_forecasts(place, model):
    """Every detection of the first 40 seconds."""
    scene = recorded(place)
    early = scene.trajectories.time_s < scene.trajectories.time_s[0] + 40.0
    scene = dataclasses.replace(scene, trajectories=scene.trajectories.select(early))
    assert_a_replay_agrees(scene, "kalman", model)
