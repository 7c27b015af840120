"""The Gaussian head, the contract of networks and the format of rows: values written down by hand."""

import numpy as np
import pytest
import torch

from pedpred.errors import ValueRuleError
from pedpred.models.contract import mean_over, reset
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
