"""The Gaussian head, the contract of networks and the format of rows: values written down by hand."""

import numpy as np
import pytest
import torch

from pedpred.errors import ValueRuleError
from pedpred.models.contract import detach, displacements, mean_over, reset, velocity_distance
from pedpred.models.features import parse_features, plain_features
from pedpred.models.gaussian import (
    GaussianHead,
    initial_spread,
    negative_log_density,
    spread_of,
)
from pedpred.models.lstm.features import LstmFeatures
from pedpred.models.mixture.features import MixtureFeatures
from tests.refused import refused
from tests.toys.architecture import ToySettings


def doubles(values):
    return torch.tensor(values, dtype=torch.float64)


def check_close(found, expected):
    assert found.shape == expected.shape
    np.testing.assert_allclose(found.detach(), expected.detach(), rtol=2e-6, atol=1e-7)


def test_density_and_its_gradients():
    """-ln N = ln(2 pi a c) + e_x^2 / (2 a^2) + r^2 / (2 c^2), r = e_y - k e_x.

    e = (1, -2), (a, c, k) = (2, 3, 0.5): r = -2.5, and -ln N = ln(12 pi) + 1/8 + 6.25/18 = 4.1020.
    """
    error = doubles([1.0, -2.0]).requires_grad_()
    spread = doubles([2.0, 3.0, 0.5]).requires_grad_()
    found = negative_log_density(error, spread)
    assert found.item() == pytest.approx(np.log(12 * np.pi) + 1 / 8 + 6.25 / 18)
    found.backward()
    # by e_x: e_x / a^2 - k r / c^2; by e_y: r / c^2
    check_close(error.grad, doubles([1 / 4 + 1.25 / 9, -2.5 / 9]))
    # by a: 1 / a - e_x^2 / a^3; by c: 1 / c - r^2 / c^3; by k: -r e_x / c^2
    check_close(spread.grad, doubles([1 / 2 - 1 / 8, 1 / 3 - 6.25 / 27, 2.5 / 9]))


def test_density_of_several_steps_pairs_errors_and_spreads():
    """ln(2 pi a c) alone where the error is 0; 0.5 (1 / 0.1)^2 = 50 more for 1 m at 0.1 m."""
    found = negative_log_density(
        doubles([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
        doubles([[0.5, 2.0, 3.0], [0.1, 1.0, 0.0], [1.0, 0.1, 0.0]]),
    )
    level = np.log(2 * np.pi)
    check_close(found, doubles([level, level + np.log(0.1) + 50, level + np.log(0.1) + 50]))


def test_huge_raw_numbers_stay_finite():
    check_close(spread_of(torch.tensor([200.0, -200.0, 1.0])), torch.tensor([200.01, 0.01, 1.0]))


def test_initial_spread_grows_by_5_cm_a_step():
    """a = c = 0.01 m + 0.05 m p at step p = 1, 2, 3; k = 0."""
    expected = [[0.06, 0.06, 0.0], [0.11, 0.11, 0.0], [0.16, 0.16, 0.0]]
    check_close(spread_of(initial_spread(3)), torch.tensor(expected))
    head = GaussianHead(4, 3)
    check_close(head(torch.zeros(1, 2, 4)), torch.tensor([[expected, expected]]))


def test_gaussian_head_is_linear_and_stops_the_gradient():
    """Raw numbers W h + b, step by step (a, c, k); the hidden state gets no gradient, W does."""
    head, hidden = GaussianHead(2, 2), torch.tensor([[0.5, -1.0]], requires_grad=True)
    weight = torch.tensor([[1.0, 2.0], [0.0, 1.0], [3.0, 0.0], [-1.0, 1.0], [2.0, 2.0], [0.5, 0.5]])
    bias = torch.tensor([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    with torch.no_grad():
        head.out.weight.copy_(weight)
        head.out.bias.copy_(bias)
    raw = weight.numpy() @ [0.5, -1.0] + bias.numpy()  # -1.4, -0.8, 1.8, -1.1, -0.5, 0.35
    positive = 0.01 + np.log(1 + np.exp(raw))
    expected = [[[positive[0], positive[1], raw[2]], [positive[3], positive[4], raw[5]]]]
    spread = head(hidden)
    np.testing.assert_allclose(spread.detach(), expected, rtol=1e-5)
    spread[..., 2].sum().backward()
    assert hidden.grad is None
    check_close(head.out.weight.grad[2], torch.tensor([0.5, -1.0]))


def test_distance_of_velocities_is_euclidean():
    """Pfeiffer et al. 2018, eq. 5: |v - v'|, with the gradient (v - v') / |v - v'|."""
    predicted = doubles([[[3.0, 0.5], [1.0, 1.0]]]).requires_grad_()
    found = velocity_distance(predicted, doubles([[[0.0, 4.5], [1.0, -1.0]]]))
    check_close(found, doubles([[5.0, 2.0]]))
    found.sum().backward()
    check_close(predicted.grad, doubles([[[0.6, -0.8], [0.0, 1.0]]]))


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_displacement_is_the_sum_of_true_minus_forecast(dt_s):
    """d_p = dt sum_{q <= p} (v'_q - v_q): the gradient of sum_p w_p d_p by v_q is -dt sum_{p >= q} w_p."""
    forecast = doubles([[[1.0, 0.0], [0.5, -1.0], [2.0, 0.25]]]).requires_grad_()
    truth = doubles([[[1.5, 1.0], [0.0, 0.0], [1.0, 4.0]]])
    found = displacements(forecast, truth, dt_s)
    # differences (0.5, 1), (-0.5, 1), (-1, 3.75)
    check_close(found, dt_s * doubles([[[0.5, 1.0], [0.0, 2.0], [-1.0, 5.75]]]))
    (found * doubles([1.0, 2.0, 5.0])[:, None]).sum().backward()
    expected = -dt_s * doubles([[[8.0, 8.0], [7.0, 7.0], [5.0, 5.0]]])
    check_close(forecast.grad, expected)


def test_mean_over_known_values_only():
    """(2 + 3 + 7) / 3 = 4, and each known value has a third of the gradient; 0 where none is known."""
    values = doubles([[2.0, 100.0, 3.0], [7.0, -50.0, 1.0]]).requires_grad_()
    known = torch.tensor([[True, False, True], [True, False, False]])
    mean = mean_over(values, known)
    assert mean.item() == pytest.approx(4.0)
    mean.backward()
    check_close(values.grad, known / 3.0)
    assert mean_over(values, values == 7.0).item() == pytest.approx(7.0)
    assert mean_over(values, known & False).item() == 0.0


def test_state_of_starting_tracks_is_zero_and_of_others_kept():
    state = {"h": torch.tensor([[1.0], [2.0], [3.0]]), "c": torch.arange(1.0, 13.0).reshape(3, 2, 2)}
    after = reset(state, torch.tensor([False, True, False]))
    assert after["h"].tolist() == [[1.0], [0.0], [3.0]]
    assert after["c"].tolist() == [[[1, 2], [3, 4]], [[0, 0], [0, 0]], [[9, 10], [11, 12]]]


def test_detached_state_has_equal_values_and_no_gradient():
    state = {"h": torch.tensor([[1.0, 2.0]], requires_grad=True) * 3.0}
    after = detach(state)
    assert after["h"].tolist() == [[3.0, 6.0]]
    assert state["h"].requires_grad
    assert not after["h"].requires_grad


def test_a_step_is_a_forward_of_one_step():
    torch.manual_seed(0)
    network = ToySettings(3, ("state", "angular")).build({"state": 2, "grid": 7, "angular": 4}, 5)
    assert network.widths == {"state": 2, "angular": 4}
    assert network.horizon_steps == 5
    start = network.start(2)
    assert start["trace"].shape == (2, 1, 3)
    assert not start["trace"].any()
    inputs = {"state": torch.randn(2, 2), "angular": torch.rand(2, 4)}
    state = {"trace": torch.randn(2, 1, 3)}
    outputs, after = network.step(inputs, state)
    whole, end = network({name: values.unsqueeze(1) for name, values in inputs.items()}, state)
    assert outputs["velocities"].shape == (2, 5, 2)
    check_close(outputs["velocities"], whole["velocities"].squeeze(1))
    check_close(after["trace"], end["trace"])


def test_all_weights_are_clipped_by_one_norm():
    network = ToySettings(3).build({"state": 2}, 5)
    (group,) = network.clipped_groups()
    assert [id(weight) for weight in group] == [id(weight) for weight in network.parameters()]


def test_sizes_of_inputs_are_parsed_by_their_kind():
    lstm = {"grid_cells": 8, "grid_resolution_m": 0.2, "angular_cells": 9, "max_range_m": 4.0}
    assert parse_features("lstm", lstm) == LstmFeatures(8, 0.2, 9, 4.0)
    mixture = MixtureFeatures(3, 5, 6.5, 12, 7.5)
    plain = {"history_steps": 3, "neighbours": 5, "neighbour_range_m": 6.5, "beams": 12, "beam_range_m": 7.5}
    assert plain_features(mixture) == plain
    assert parse_features("mixture", plain) == mixture
    with refused("model"):
        parse_features("gru", {})
    with pytest.raises(ValueRuleError, match=r"inputs.*beams"):
        parse_features("mixture", {"beams": 6}, "inputs")
