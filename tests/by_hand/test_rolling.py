"""Networks along whole tracks, and as forecasters: equal to single steps in plain loops."""

import dataclasses

import numpy as np
import pytest
import torch

from pedpred.datasets.rows import Spans
from pedpred.evaluation.windows import find_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.forecasting.blocks import forecast_blocks
from pedpred.forecasting.postprocessing import Postprocessing
from pedpred.models.forecaster import NetworkForecaster
from pedpred.models.lstm.autoencoder import GridEncoder
from pedpred.models.lstm.features import LstmFeatures
from pedpred.models.rolling import outputs_at_instants
from pedpred.scenes import Predictions, Scene, Trajectories
from pedpred.training.sequences import run_over_sequences
from tests.exported import TRACKER, rows_of
from tests.toys.architecture import ToyNetwork, ToySettings
from tests.worlds import blocked

STEPS = 3
LENGTHS = [3, 70, 1, 33, 64, 32]


def toy(channels=("state", "angular"), widths=None, units=4):
    """h(t) = tanh(W x(t) + b + h(t - 1) / 2) gives velocities V h(t) + c."""
    torch.manual_seed(0)
    return ToySettings(units, channels).build(widths or {"state": 2, "angular": 3}, STEPS).eval()


def steps_by_hand(network, inputs):
    """Velocities after every step of one track, from [T, width] of all channels side by side. [T, P, 2]."""
    w = {name: weights.detach().numpy() for name, weights in network.named_parameters()}
    trace, found = np.zeros(len(w["read.bias"])), []
    for x in inputs:
        trace = np.tanh(w["read.weight"] @ x + w["read.bias"] + 0.5 * trace)
        found.append((w["out.weight"] @ trace + w["out.bias"]).reshape(STEPS, 2))
    return np.array(found)


def tracks(lengths):
    """Random inputs of some tracks, one behind the other, and the rows of each."""
    edges = np.concatenate([[0], np.cumsum(lengths)])
    rng = np.random.default_rng(0)
    state, angular = (rng.normal(size=(edges[-1], width)).astype(np.float32) for width in (2, 3))
    return state, angular, np.stack([edges[:-1], edges[1:]], axis=-1)


@pytest.mark.parametrize("lengths", [LENGTHS, [2] * 130 + [1] * 100 + [3, 35] * 20, [1]])
def test_whole_tracks_are_rolled_with_their_memory(lengths):
    """Longer than one block of 32 steps, or more than one block of 256 tracks: nobody's memory is lost."""
    state, angular, spans = tracks(lengths)
    given = {"angular": torch.from_numpy(angular), "spans": Spans(spans, *np.zeros((3, len(spans)), int))}
    data = rows_of(torch.from_numpy(state), torch.zeros(len(state), STEPS, 2), 1, **given)
    network, found = toy(), np.full((len(state), STEPS, 2), np.nan)
    counts = np.zeros(len(state), int)
    for rows, outputs in run_over_sequences(network, data, spans):
        assert outputs.keys() == {"velocities"}
        found[rows] = outputs["velocities"]
        counts[rows] += 1
        assert len(rows) <= 32 * 256
    assert (counts == 1).all()
    inputs = np.concatenate([state, angular], axis=-1)
    for first, last in spans:
        np.testing.assert_allclose(found[first:last], steps_by_hand(network, inputs[first:last]), atol=1e-5)


def test_tracks_of_similar_length_are_rolled_together():
    """Rows 0 to 1 of 259 tracks, the longest first: 256 x 32 steps, of which 2 x 70 and 257 x 1 are real."""
    state, angular, spans = tracks([1] * 257 + [70] * 2)
    data = rows_of(
        torch.from_numpy(state), torch.zeros(len(state), STEPS, 2), 1, angular=torch.from_numpy(angular)
    )
    sizes = [len(rows) for rows, _ in run_over_sequences(toy(), data, spans)]
    assert sizes == [2 * 32 + 254, 2 * 32, 2 * 6, 3]


def recalled(network, lengths, instants):
    """`outputs_at_instants` at instants (track, steps before, on a step), and the expected velocities."""
    state, angular, spans = tracks(lengths)
    track, before, on_step = (np.array(column) for column in zip(*instants, strict=True))
    rng = np.random.default_rng(1)
    now = [rng.normal(size=(len(instants), width)).astype(np.float32) for width in (2, 3)]
    steps = {"state": torch.from_numpy(state), "angular": torch.from_numpy(angular)}
    asked = {"state": torch.from_numpy(now[0]), "angular": torch.from_numpy(now[1])}
    found = outputs_at_instants(network, steps, asked, spans[track, 0], before, on_step.astype(bool))
    inputs, expected = np.concatenate([state, angular], axis=-1), []
    for i, (k, b, on) in enumerate(instants):
        first = spans[k, 0]
        last = inputs[first + b] if on else np.concatenate([now[0][i], now[1][i]])
        expected.append(steps_by_hand(network, [*inputs[first : first + b], last])[-1])
    assert found.keys() == {"velocities"}
    return found["velocities"].numpy(), np.array(expected)


INSTANTS = [
    (1, 4, 1), (3, 2, 0), (0, 3, 0), (3, 0, 1), (1, 4, 0),
    (0, 0, 0), (1, 5, 0), (3, 2, 1), (1, 4, 0), (1, 0, 1),
]  # fmt: skip
"""Tracks 0, 1 and 3 of 3, 6, 2 and 4 steps: at or behind a step, before the first, behind the last one."""


@pytest.mark.parametrize(
    "instants", [INSTANTS, [(2, 0, 0)], [(2, 0, 0), (0, 0, 0)], [(3, 3, 1)], [(3, 4, 0), (0, 1, 1)]]
)
def test_instants_have_the_memory_of_the_steps_before(instants):
    """On a step: its own output; between: fresh inputs behind the steps before, which go on without them."""
    found, expected = recalled(toy(), [3, 6, 2, 4], instants)
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_many_tracks_are_recalled_in_blocks():
    """600 tracks in three blocks of 256, with up to 5 steps; one or two instants each, in any order."""
    rng = np.random.default_rng(2)
    lengths = rng.integers(1, 6, 600)
    instants = []
    for k in [*range(600), *range(0, 600, 3)]:
        on = int(rng.integers(2))
        instants.append((k, int(rng.integers(0, lengths[k] + 1 - on)), on))
    instants = [instants[i] for i in rng.permutation(len(instants))]
    found, expected = recalled(toy(), lengths, instants)
    np.testing.assert_allclose(found, expected, atol=1e-5)


def asked_along(dt_s, every_s, starts_s=(0.0, 0.55), detections=(11, 8)):
    """A request about every detection of people on curves, on the clock of `dt_s` or between its steps."""
    parts = list(zip((4, 9, 5), starts_s, detections, strict=False))
    track = np.repeat([k for k, _, _ in parts], [n for _, _, n in parts])
    after_s = np.concatenate([np.arange(n) * every_s for _, _, n in parts])
    time_s = after_s + np.repeat([start for _, start, _ in parts], [n for _, _, n in parts])
    after_s = after_s + 0.02 * track
    place = np.stack([1.1 * after_s - 2.0, np.sin(after_s) + 0.1 * (track == 9)], axis=-1)
    ground = blocked((slice(90, 98), slice(90, 120)))
    order = np.lexsort((time_s, track))
    scene = Scene("walk", Trajectories(time_s[order], track[order], place[order]), ground, every_s)
    sizes = ForecastProtocol(dt_s=dt_s, horizon_steps=STEPS)
    request = find_windows(scene, Perception(TRACKER, 0.2), sizes).request
    return dataclasses.replace(request, rows=np.random.default_rng(3).permutation(len(request.table)))


@pytest.mark.parametrize(("dt_s", "every_s"), [(0.3, 0.3), (0.4, 0.4), (0.3, 0.25), (0.4, 0.3)])
def test_forecasts_are_single_steps_along_the_clock(dt_s, every_s):
    """v(t) of the asked instant behind all steps of the clock before it; positions are sums of dt v."""
    features, encoder = LstmFeatures(), GridEncoder(60, 3)
    widths = {"state": 2, "grid": 392, "angular": 72}
    network, request = toy(("state", "grid", "angular"), widths), asked_along(dt_s, every_s)
    found = NetworkForecaster(network, features, encoder)(request)
    clock, table = request.steps, request.asked
    inputs = []
    for one in (clock, table):
        row = request.past.last_row(one.track_id, one.time_s)
        stored = request.inputs(features, row, one.time_s)
        bits = np.unpackbits(stored["occupancy"], axis=-1, bitorder="little").reshape(-1, 60, 60)
        code = encoder.embedding(torch.from_numpy(bits).float()).detach().numpy()
        inputs.append(np.concatenate([stored["state"], code, 1 - stored["angular_grid"] / 6], axis=-1))
    assert inputs[0][:, 2:394].std(axis=0).max() > 0.01  # obstacles are in sight
    for i in range(len(table)):
        earlier = (clock.track_id == table.track_id[i]) & (clock.time_s < table.time_s[i] - 1e-4)
        velocities = steps_by_hand(network, [*inputs[0][earlier], inputs[1][i]])[-1]
        path = np.cumsum(dt_s * velocities, axis=0)
        c, s = np.cos(table.heading_rad[i]), np.sin(table.heading_rad[i])
        world = table.position[i] + path @ np.array([[c, s], [-s, c]])
        np.testing.assert_allclose(found.path[i, 1], world, atol=1e-4)
        np.testing.assert_allclose(found.point[i], world, atol=1e-4)
    assert (found.frame, found.dt_s) == ("world", dt_s)


class Glance(ToyNetwork):
    """Without memory: two modes, of half the velocity and of the whole one, which is the more likely one."""

    state_shapes = {}  # noqa: RUF012

    def forward(self, inputs, state):
        read = self.read(torch.cat([inputs[name] for name in self.widths], -1))
        return {"velocities": self.out(torch.tanh(read)).unflatten(-1, (-1, 2))}, state

    def decode(self, outputs, dt_s):
        path = torch.cumsum(outputs["velocities"] * dt_s, dim=-2)
        weight = torch.tensor([0.4, 0.6]).expand(len(path), 2)
        covariance = 0.04 * torch.eye(2).expand(len(path), 2, path.shape[1], 2, 2)
        modes = torch.stack([0.5 * path, path], dim=1)
        return {**outputs, "path": modes, "weight": weight, "covariance": covariance}


NO_LINK = (False, False, False)


@pytest.mark.parametrize(
    ("dt_s", "choice"),
    [
        (0.3, (False, True, False)),
        (0.4, (True, False, False)),
        (0.4, (False, True, False)),
        (0.4, (False, False, True)),
    ],
)
def test_networks_without_memory_forecast_through_blocks(dt_s, choice):
    """Own inputs, agent frame, then `forecast_blocks` likewise; people in the order asked for."""
    torch.manual_seed(0)
    network = Glance(ToySettings(4, ("state", "angular")), {"state": 2, "angular": 72}, STEPS)
    request = asked_along(dt_s, dt_s, (0.0, 0.0, 50.0 * dt_s), (40, 40, 20))
    request = dataclasses.replace(request, detection_noise_m=0.15)
    w = {name: weights.detach().numpy() for name, weights in network.named_parameters()}

    def infer(row, inputs):
        x = np.concatenate([inputs["state"], 1 - inputs["angular_grid"] / 6], axis=-1)
        hidden = np.tanh(x @ w["read.weight"].T + w["read.bias"])
        velocities = (hidden @ w["out.weight"].T + w["out.bias"]).reshape(-1, STEPS, 2)
        path, many = np.cumsum(dt_s * velocities, axis=1), np.ones((len(row), 1))
        covariance = 0.04 * np.broadcast_to(np.eye(2), (len(row), 2, STEPS, 2, 2))
        return Predictions(path, np.stack([path, path / 2], 1), many * [0.6, 0.4], dt_s, covariance, "agent")

    chosen, alone = (
        NetworkForecaster(network, LstmFeatures(4), None, *links)(request) for links in (choice, NO_LINK)
    )
    steps = Postprocessing(**dict(zip(("together", "learning", "trust"), choice, strict=True)), noise_m=0.15)
    differs = False
    for which, part in forecast_blocks(request, LstmFeatures(4), infer, steps):
        for name, values in part.arrays().items():
            np.testing.assert_allclose(getattr(chosen, name)[which], values, atol=1e-4, err_msg=name)
            differs |= np.abs(getattr(alone, name)[which] - values).max() > 0.01
    assert differs


def test_nobody_asked_about_gets_no_forecast():
    request = dataclasses.replace(asked_along(0.4, 0.4), rows=np.zeros(0, int))
    found = NetworkForecaster(toy(), LstmFeatures(), None)(request)
    assert (found.point.shape, found.path.shape, found.dt_s) == ((0, STEPS, 2), (0, 1, STEPS, 2), 0.4)
