"""Recorded people, replayed online frame by frame, get the forecasts that the offline pipeline makes."""

import dataclasses

import numpy as np
import pytest

from pedpred.features import FeatureSettings, extract
from pedpred.networks import NetworkForecaster
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.replay import predictions_at, replayed
from pedpred.tracking import follow
from tests.exported import TRACKER
from tests.worlds import PLACES, recorded, walled_scene


def offline_and_online(scene, kind, phase_offsets, model):
    """The feature table; (path, covariance) of each row from it, and from a replay (NaN between frames)."""
    folder, network, encoder = model
    settings = FeatureSettings(phase_offsets=phase_offsets)
    tracks = follow(scene.trajectories, kind, TRACKER if kind == "kalman" else None, 0.2)
    table = extract(scene, tracks, settings)
    whole = NetworkForecaster(network, encoder).predict(table, settings, np.arange(len(table)))
    robot = OnlinePredictor.load(folder, OnlineSettings.as_offline(settings, scene.detection_dt_s))
    forecasts = replayed(scene, robot, kind == "truth")
    online = predictions_at(forecasts, table.track_id, table.time_s, 10, settings.dt_s)
    return table, *((own.point, own.covariance[:, 0]) for own in (whole, online))


SOURCES = [("kalman", 0.4, 3), ("kalman", 0.1, 1), ("truth", 0.3, 1)]


@pytest.mark.parametrize(("kind", "dt_s", "phase_offsets"), SOURCES)
def test_a_replay_gives_the_offline_forecasts(model, kind, dt_s, phase_offsets):
    """At every step that coincides with a detection: annotations, a fast tracker, a simulation."""
    scene = walled_scene(np.random.default_rng(1), dt_s, kind == "truth", detections=int(10 / dt_s))
    table, offline, online = offline_and_online(scene, kind, phase_offsets, model)
    instants = np.unique(scene.trajectories.time_s)
    detected = np.abs(table.time_s[:, None] - instants).min(axis=1) < 1e-6
    assert detected.sum() > 20
    for replay, whole in zip(online, offline, strict=True):  # paths, covariances
        np.testing.assert_allclose(replay[detected], whole[detected], atol=1e-4, rtol=1e-4)
        assert np.isnan(replay[~detected]).all()


@pytest.mark.parametrize("place", ["eth", "hotel"])
def test_real_recordings_give_the_offline_forecasts(place, ewap_folder, model):
    """Every evaluation window of the first 40 seconds, on three clocks that are one detection apart."""
    scene, phase_offsets = recorded(ewap_folder, place), PLACES[place]["phase_offsets"]
    early = scene.trajectories.time_s < scene.trajectories.time_s[0] + 40.0
    scene = dataclasses.replace(scene, trajectories=scene.trajectories.select(early))
    table, offline, online = offline_and_online(scene, "kalman", phase_offsets, model)
    assert table.window.sum() > 100
    assert set(table.phase[table.window]) == set(range(phase_offsets))
    for replay, whole in zip(online, offline, strict=True):
        np.testing.assert_allclose(replay[table.window], whole[table.window], atol=1e-4, rtol=1e-4)
