"""An architecture that is added goes through training, storage, forecasting, export and online use."""

import dataclasses

import numpy as np
import pytest
import torch

from pedpred.errors import ValueRuleError
from pedpred.evaluation.windows import find_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.models import ARCHITECTURES, Architecture
from pedpred.models.forecaster import NetworkForecaster
from pedpred.models.lstm.autoencoder import GridEncoder
from pedpred.models.registry import load_network, parse_settings
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.replay import replay_scene
from pedpred.tracking import KalmanBank
from pedpred.training import train
from tests.exported import LSTM_ROWS, TRACKER, train_on, write_model, write_network
from tests.toys.architecture import ToySettings
from tests.trainings import QUICK, toy_data
from tests.worlds import walled_scene

MADE_WITH = dataclasses.replace(LSTM_ROWS, protocol=ForecastProtocol(horizon_steps=4))


@pytest.fixture
def network(monkeypatch, tmp_path):
    """Trained for a moment, written and read."""
    monkeypatch.setitem(ARCHITECTURES, "toy", Architecture(f"{ToySettings.__module__}.ToySettings", "lstm"))
    data = toy_data(np.random.default_rng(0))
    torch.manual_seed(0)
    toy = parse_settings({"architecture": "toy", "units": 6}).build(data.widths, data.horizon_steps)
    long = dataclasses.replace(QUICK, steps=30, validate_every=15)
    learner = train_on(toy, data, data.spans.rows, data.spans.rows, long)
    curve = train(learner, tmp_path / "run", "toy")
    assert curve[-1]["validation_distance"] < curve[0]["validation_distance"]
    write_network(tmp_path / "toy", toy, MADE_WITH)
    return load_network(tmp_path / "toy")


def test_a_network_that_cannot_be_traced_is_refused(network, tmp_path, monkeypatch):
    own = type(network).decode

    def decode(network, outputs, dt_s):
        known = own(network, outputs, dt_s)
        first = known["path"][..., 0, :, :]
        fixed = torch.zeros(first.shape)  # of as many people as are traced
        return known | {"path": torch.stack([first, fixed], dim=-3)}

    monkeypatch.setattr(type(network), "decode", decode)
    with pytest.raises(ValueRuleError):
        write_model(tmp_path, network, GridEncoder(60), MADE_WITH)
    assert not (tmp_path / "network.onnx").exists()


def test_modes_travel_from_the_network_to_the_robot(network, tmp_path):
    """Offline and online give the same modes, the most likely one first."""
    protocol, scene = MADE_WITH.protocol, walled_scene(np.random.default_rng(1), 0.3)
    request = find_windows(scene, Perception(KalmanBank.around(TRACKER), 0.2), protocol).request
    table = request.table
    everybody = dataclasses.replace(request, rows=np.arange(len(table)))
    offline = NetworkForecaster(network, MADE_WITH.features, None)(everybody)
    assert offline.modes == 2
    np.testing.assert_allclose(offline.weight, np.tile([2 / 3, 1 / 3], (len(table), 1)), atol=1e-4)
    np.testing.assert_allclose(offline.most_likely, table.position[:, None].repeat(4, axis=1), atol=1e-9)
    np.testing.assert_allclose(offline.path[:, 1], offline.point, atol=1e-5)

    assert write_model(tmp_path, network, GridEncoder(60), MADE_WITH).memory == {"trace": (1, 6)}
    robot = OnlinePredictor.load(tmp_path, OnlineSettings.as_offline(protocol, scene.detection_dt_s))
    compared = 0
    for forecast in replay_scene(scene, robot):
        now = np.flatnonzero(np.abs(table.time_s - forecast.time_s) < 1e-6)
        own = np.searchsorted(forecast.track_id, table.track_id[now])
        np.testing.assert_allclose(forecast.predictions.path[own], offline.path[now], atol=1e-4)
        np.testing.assert_allclose(forecast.position[own], offline.point[now], atol=1e-4)
        assert forecast.covariance is None
        compared += len(now)
    assert compared == len(table)
