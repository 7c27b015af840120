"""The paper's network beside plain numpy: gates, fusion, loss (eq. 5) and its gradient, augmentation."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from pedpred.datasets import LaneBatch
from pedpred.models.lstm.autoencoder import GridEncoder
from pedpred.models.lstm.network import ChannelWidths, LstmSettings
from pedpred.training.augmentation import Augmentation, augment, look_up
from tests.exported import lstm, rows_of
from tests.refused import refused

WIDTHS = {"angular": 4, "grid": 5, "state": 2}
SETTINGS = lstm(4, 7, {"grid": (2, 3), "state": (3, 2)}, uncertainty="gaussian")
STEPS = 3


def built(settings=SETTINGS, widths=WIDTHS):
    """A network with large random weights in double precision."""
    torch.manual_seed(1)
    network = settings.build(widths, STEPS).double().eval()
    for weights in network.parameters():
        torch.nn.init.normal_(weights, std=0.7)
    return network


def sigmoid(x):
    return 1 / (1 + np.exp(-x))


def lstm_step(w, name, x, hidden, cell):
    """Hochreiter & Schmidhuber 1997: i, f, o = sigma(W x + U h + b), g = tanh(...); c = f c + i g."""
    gates = x @ w[f"{name}.weight_ih_l0"].T + w[f"{name}.bias_ih_l0"]
    gates = gates + hidden @ w[f"{name}.weight_hh_l0"].T + w[f"{name}.bias_hh_l0"]
    i, f, g, o = np.split(gates, 4, axis=-1)
    cell = sigmoid(f) * cell + sigmoid(i) * np.tanh(g)
    return sigmoid(o) * np.tanh(cell), cell


def by_hand(network, inputs, state, residual=True):
    """Figure 2 of the paper, step by step: velocities, spread and the state behind the last step."""
    w = {name: weights.detach().numpy() for name, weights in network.named_parameters()}
    state, velocities, spreads = {k: v.numpy() for k, v in state.items()}, [], []
    for step in range(inputs["state"].shape[1]):
        fused = []
        for name in ("state", "grid"):
            x = inputs[name][:, step].numpy() @ w[f"projections.{name}.weight"].T
            x = x + w[f"projections.{name}.bias"]
            before = state[f"{name}_hidden"], state[f"{name}_cell"]
            after = lstm_step(w, f"lstms.{name}", np.where(x > 0, x, 0.1 * x), *before)
            state[f"{name}_hidden"], state[f"{name}_cell"] = after
            fused.append(after[0])
        before = state["joint_hidden"], state["joint_cell"]
        joint, state["joint_cell"] = lstm_step(w, "joint", np.concatenate(fused, axis=-1), *before)
        state["joint_hidden"] = joint
        head = np.maximum(joint @ w["head.weight"].T + w["head.bias"], 0)
        path = (head @ w["out.weight"].T + w["out.bias"]).reshape(-1, STEPS, 2)
        velocities.append(path + residual * inputs["state"][:, step].numpy()[:, None])
        raw = (joint @ w["uncertainty.out.weight"].T + w["uncertainty.out.bias"]).reshape(-1, STEPS, 3)
        spreads.append(np.concatenate([0.01 + np.log1p(np.exp(raw[..., :2])), raw[..., 2:]], axis=-1))
    return np.stack(velocities, 1), np.stack(spreads, 1), state


def some_inputs(lanes=2, length=4):
    rng = torch.Generator().manual_seed(3)
    return {
        name: torch.randn(lanes, length, width, generator=rng, dtype=torch.float64)
        for name, width in WIDTHS.items()
    }


def some_state(network, lanes=2):
    rng = torch.Generator().manual_seed(4)
    zeros = network.start(lanes)
    return {k: torch.randn(v.shape, generator=rng, dtype=torch.float64) for k, v in zeros.items()}


@pytest.mark.parametrize("residual", [True, False])
def test_forward_is_figure_two_step_by_step(residual):
    network, inputs = built(replace(SETTINGS, residual=residual)), some_inputs()
    state = some_state(network)
    outputs, after = network(inputs, state)
    velocities, spread, expected = by_hand(network, inputs, state, residual)
    assert outputs.keys() == {"velocities", "spread"}
    np.testing.assert_allclose(outputs["velocities"].detach(), velocities, rtol=1e-9)
    np.testing.assert_allclose(outputs["spread"].detach(), spread, rtol=1e-9)
    assert after.keys() == expected.keys()
    for name, value in expected.items():
        np.testing.assert_allclose(after[name].detach(), value, rtol=1e-9)


def test_state_has_a_hidden_and_a_cell_part_of_each_lstm():
    shapes = {"state_hidden": (2,), "state_cell": (2,), "grid_hidden": (3,), "grid_cell": (3,)}
    network = built()
    shapes |= {"joint_hidden": (4,), "joint_cell": (4,)}
    assert list(network.state_shapes.items()) == list(shapes.items())
    assert {k: v.shape for k, v in network.start(5).items()} == {k: (5, *v) for k, v in shapes.items()}


def test_dropout_is_in_front_of_the_head_only():
    """p = 3/4: a unit is 0 or 4 times as large in training; head and output pass the units on as they are."""
    settings = lstm(6, 6, {"state": (3, 2)}, dropout=0.75, residual=False, uncertainty="gaussian")
    network = built(settings)
    with torch.no_grad():
        for layer in (network.head, network.out):
            layer.weight.copy_(torch.eye(6))
            layer.bias.zero_()
    whole, _ = network(some_inputs(), network.start(2))
    network.train()
    dropped, _ = network(some_inputs(), network.start(2))
    factor = (dropped["velocities"] / whole["velocities"])[whole["velocities"] > 0].detach().numpy()
    assert set(np.round(factor, 6)) == {0.0, 4.0}
    np.testing.assert_array_equal(dropped["spread"].detach(), whole["spread"].detach())


def test_spread_has_no_gradient_into_the_mean():
    network = built()
    outputs, _ = network(some_inputs(), network.start(2))
    outputs["spread"].sum().backward()
    trained = {name for name, weights in network.named_parameters() if weights.grad is not None}
    assert trained == {"uncertainty.out.weight", "uncertainty.out.bias"}


OFF = np.array(
    [[[3.0, 4.0], [-0.5, 1.2], [1.5, -0.8]], [[0.3, -0.4], [9.0, 9.0], [9.0, 9.0]], [[7.0] * 2] * 3]
)
"""Forecast minus truth of three people, m/s; norms 5, 1.3, 1.7 and 0.5 where the truth is known."""
KNOWN = np.array([[True, True, True], [True, False, False], [False, False, False]])
A, C, K = 0.7, 0.4, -0.6


def outputs_and_truth():
    truth = np.arange(18.0).reshape(3, 3, 2) / 7
    velocities = torch.tensor(truth + OFF, requires_grad=True)
    spread = torch.tensor([A, C, K], dtype=torch.float64).repeat(3, 3, 1).requires_grad_()
    return {"velocities": velocities, "spread": spread}, torch.from_numpy(truth), torch.from_numpy(KNOWN)


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_likelihood_of_positions_trains_the_spread_alone(dt_s):
    """Eq. 5 is (5 + 1.3 + 1.7 + 0.5) / 4 with the gradient (u - v) / |u - v| / 4. Added to it is the mean of
    ln(2 pi a c) + (x / a)^2 / 2 + ((y - k x) / c)^2 / 2 over known steps; (x, y) is the sum of
    dt (truth - forecast): -(3, 4), -(2.5, 5.2), -(4, 4.4) and -(0.3, -0.4) dt.
    """
    outputs, truth, known = outputs_and_truth()
    certain = built().loss({"velocities": outputs["velocities"]}, truth, known, dt_s)
    assert [value.item() for value in certain] == pytest.approx([2.125, 2.125, 4])
    found = built().loss(outputs, truth, known, dt_s)
    x, y = -dt_s * np.array([[3.0, 2.5, 4.0, 0.3], [4.0, 5.2, 4.4, -0.4]])
    miss = y - K * x
    likelihood = np.log(2 * np.pi * A * C) + 0.5 * (x / A) ** 2 + 0.5 * (miss / C) ** 2
    assert found.total.item() == pytest.approx(2.125 + likelihood.sum() / 4)
    assert found.reported.item() == pytest.approx(2.125)
    found.total.backward()
    by_v = np.array([[[0.6, 0.8], [-5 / 13, 12 / 13], [15 / 17, -8 / 17]], [[0.6, -0.8], [0, 0], [0, 0]]])
    np.testing.assert_allclose(outputs["velocities"].grad[:2], by_v / 4, atol=1e-12)
    assert not outputs["velocities"].grad[2].any()
    by_a, by_c, by_k = 1 / A - x**2 / A**3, 1 / C - miss**2 / C**3, -miss * x / C**2
    expected = np.zeros((3, 3, 3))
    expected[KNOWN] = np.stack([by_a, by_c, by_k], axis=-1) / 4
    np.testing.assert_allclose(outputs["spread"].grad, expected, atol=1e-9)


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_scores_are_displacement_and_likelihood_of_each_step(dt_s):
    outputs, truth, _ = outputs_and_truth()
    network = built()
    scores = network.scores(outputs, truth, dt_s)
    assert tuple(scores) == network.score_names == ("ade_m", "nll")
    off = dt_s * np.array([[-3.0, -4.0], [-2.5, -5.2], [-4.0, -4.4]])
    np.testing.assert_allclose(scores["ade_m"][0].detach(), np.hypot(*off.T))
    x, y = off.T
    nll = np.log(2 * np.pi * A * C) + 0.5 * (x / A) ** 2 + 0.5 * ((y - K * x) / C) ** 2
    np.testing.assert_allclose(scores["nll"][0].detach(), nll)
    certain = built(replace(SETTINGS, uncertainty="none"))
    assert tuple(certain.scores({"velocities": truth}, truth, dt_s)) == certain.score_names == ("ade_m",)


def test_answer_is_velocities_and_one_covariance_per_step():
    """[[a^2, k a^2], [k a^2, k^2 a^2 + c^2]], with an axis of one mode in front of the steps."""
    outputs, _, _ = outputs_and_truth()
    found = built().decode(outputs, 0.3)
    assert found["velocities"] is outputs["velocities"]
    assert found["covariance"].shape == (3, 1, 3, 2, 2)
    expected = [[0.49, -0.294], [-0.294, 0.3364]]
    np.testing.assert_allclose(found["covariance"][1, 0, 2].detach(), expected)
    assert built().decode({"velocities": outputs["velocities"]}, 0.3).keys() == {"velocities"}


def test_mean_and_spread_are_clipped_apart():
    network = built()
    mean, spread = network.clipped_groups()
    assert [id(w) for w in spread] == [id(w) for w in network.uncertainty.parameters()]
    assert {id(w) for w in mean} | {id(w) for w in spread} == {id(w) for w in network.parameters()}
    assert len(mean) + len(spread) == len(list(network.parameters()))
    certain = built(replace(SETTINGS, uncertainty="none"))
    assert [len(group) for group in certain.clipped_groups()] == [len(list(certain.parameters())), 0]


def test_projection_of_the_grid_becomes_the_encoders():
    encoder = GridEncoder(12, 6).double()
    network = built(lstm(4, 7, {"state": (3, 2), "grid": (6, 3)}), {"state": 2, "grid": 8})
    before = {name: weights.clone() for name, weights in network.state_dict().items()}
    network.take_encoder(encoder)
    after = network.state_dict()
    np.testing.assert_array_equal(after.pop("projections.grid.weight"), encoder.fc.weight.detach())
    np.testing.assert_array_equal(after.pop("projections.grid.bias"), encoder.fc.bias.detach())
    assert all(torch.equal(weights, before[name]) for name, weights in after.items())
    built(lstm(4, 7, {"state": (3, 2)})).take_encoder(encoder)  # has no such channel


def test_settings_name_channels_in_one_order():
    plain = {"channels": {"angular": {"projection": 2, "lstm": 3}, "state": {"projection": 4, "lstm": 5}}}
    plain |= {"joint": 6, "head": 7, "residual": False}
    settings = LstmSettings.parse(plain)
    assert settings.channels_read == ("state", "angular")
    assert settings.channels == {"state": ChannelWidths(4, 5), "angular": ChannelWidths(2, 3)}
    assert (settings.dropout, settings.uncertainty) == (0.0, "none")
    assert settings.plain() == plain | {"dropout": 0.0, "uncertainty": "none"}
    LstmSettings.parse(plain | {"joint": 1, "head": 65536, "dropout": 0.999})
    wrong = [("channels", {}), ("joint", 0), ("head", 65537), ("dropout", 1.0), ("uncertainty", "cauchy")]
    for name, value in [*wrong, ("channels", {"state": {"projection": 0, "lstm": 5}})]:
        with refused(name):
            LstmSettings.parse(plain | {name: value})


LANES = np.array([[3, 4, 5], [8, -1, -1], [0, 1, -1], [6, 7, 9]])
CHANCE = np.array([[0.2, 0.25, 0.9], [0.7, 0.5, 0.1], [0.4, 0.75, 0.3], [0.41, 0.125, 0.35]], np.float32)
HOW = Augmentation(0.41, (0.5, 1.7), 0.3001, 0.2, 0.45, 0.6)


def drawn(how=HOW, seed=5):
    starts = np.array([True, False, False, True])
    return augment(LaneBatch(LANES, starts, CHANCE), how, np.random.default_rng(seed))


def test_lanes_below_a_share_swap_stand_or_have_another_pace():
    """Pace 0.5 + 1.2 u, or 0.1 u where the third number is below the share; lanes 0 and 2 swap."""
    found = drawn()
    assert found.mirrored.tolist() == [True, False, True, False]  # 0.41 is not below 0.41
    np.testing.assert_allclose(found.pace, [0.8, 0.05, 0.075, 0.65], rtol=1e-6)
    assert found.starts.tolist() == [True, False, False, True]
    np.testing.assert_array_equal(found.rows, LANES)


def test_hidden_people_ground_and_noise_follow_the_generator():
    """People are hidden step by step, ground lane by lane; a swapped lane has the ground before it."""
    found, rng = drawn(), np.random.default_rng(5)
    unseen, unmapped = rng.random((4, 3)) < 0.45, rng.random((4, 1)) < 0.6
    assert 0 < unseen.sum() < 12
    assert 0 < unmapped.sum() < 4
    np.testing.assert_array_equal(found.crowd, np.where(unseen, -1, LANES))
    np.testing.assert_array_equal(found.scenery, np.where(unmapped, -1, LANES[[3, 1, 1, 3]]))
    np.testing.assert_allclose(
        found.noise_mps, 0.2 * rng.standard_normal((4, 3, 2), dtype=np.float32), rtol=1e-6
    )


def test_mirrored_inputs_and_targets_are_scaled_and_turned_over():
    """state = pace (v_x, +-v_y) + noise, truth = pace (v_x, +-v_y), cone k <-> K - 1 - k."""
    rng = np.random.default_rng(0)
    state, future, cones, codes = (
        torch.from_numpy(rng.random((10, *shape), np.float32)) for shape in ((2,), (3, 2), (5,), (4,))
    )
    free = torch.tensor([9.0, 8.0, 7.0, 6.0])
    data = rows_of(state, future, 1, angular=cones, grid=codes, empty={"grid": free})
    batch = drawn()
    inputs, truth = look_up(data, batch)
    for lane, step in np.ndindex(4, 3):
        row, crowd, scenery = (int(part[lane, step]) for part in (batch.rows, batch.crowd, batch.scenery))
        mirrored, pace = lane in (0, 2), [0.8, 0.05, 0.075, 0.65][lane]
        sign = np.array([pace, -pace if mirrored else pace])
        own = state[row].numpy() if row >= 0 else np.zeros(2)
        np.testing.assert_allclose(
            inputs["state"][lane, step], own * sign + batch.noise_mps[lane, step].numpy(), rtol=1e-5
        )
        if row >= 0:
            np.testing.assert_allclose(truth[lane, step], future[row].numpy() * sign, rtol=1e-5)
        around = cones[crowd].numpy() if crowd >= 0 else np.zeros(5)
        np.testing.assert_array_equal(inputs["angular"][lane, step], around[::-1] if mirrored else around)
        np.testing.assert_array_equal(inputs["grid"][lane, step], codes[scenery] if scenery >= 0 else free)


def test_a_part_of_an_augmented_batch_is_some_of_its_lanes():
    found, whole = drawn().part(slice(1, 3), torch.device("cpu")), drawn()
    for name, values in vars(whole).items():
        np.testing.assert_array_equal(getattr(found, name), values[1:3])


def test_nothing_is_augmented_by_default():
    found = drawn(Augmentation())
    assert not found.mirrored.any()
    assert found.pace.tolist() == [1.0] * 4
    assert not found.noise_mps.any()
    for rows in (found.crowd, found.scenery):
        np.testing.assert_array_equal(rows, LANES)
