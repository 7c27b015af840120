"""Spread of forecasts: a proper Gaussian, learned beside the mean without touching it."""

import dataclasses

import pytest
import torch

from pedpred.errors import ValueRuleError
from pedpred.models.contract import displacements
from pedpred.models.gaussian import covariance_of
from pedpred.models.registry import parse_settings, plain_settings
from pedpred.training import train
from tests import test_learning
from tests.exported import lstm, roll, rows_of, train_on

MEAN_ONLY = lstm(16, 16, {"state": (8, 8)}, dropout=0.2)
WITH_SPREAD = dataclasses.replace(MEAN_ONLY, uncertainty="gaussian")
QUICK = dataclasses.replace(test_learning.QUICK, longest_track=40, clip_norm=0.1)


def noisy_walks(error_m, tracks=12):
    """People at 1 m/s whose next positions are off by `error_m` [rows, 3, 2] from a straight line."""
    straight = torch.tensor([1.0, 0.0]).expand(error_m.shape)
    steps = torch.diff(error_m, dim=1, prepend=torch.zeros(len(error_m), 1, 2)) / 0.3
    return rows_of(straight[:, 0].clone(), straight + steps, tracks)


def trained(shape, data, scratch, **changes):
    torch.manual_seed(1)
    network = shape.build({"state": 2}, 3)
    how = dataclasses.replace(QUICK, **changes)
    curve = train(train_on(network, data, data.spans.rows, data.spans.rows, how), scratch, "toy")
    return network.eval(), curve


def test_the_mean_is_to_the_last_bit_what_it_is_without_a_spread(tmp_path):
    data = noisy_walks(torch.randn(360, 3, 2, generator=torch.Generator().manual_seed(0)))
    plain, curve = trained(MEAN_ONLY, data, tmp_path / "plain")
    spread, other = trained(WITH_SPREAD, data, tmp_path / "spread")
    untouched = spread.state_dict()
    assert all(torch.equal(weight, untouched[name]) for name, weight in plain.state_dict().items())
    assert [row["validation_ade_m"] for row in curve] == [row["validation_ade_m"] for row in other]
    assert set(roll(plain, data, data.spans.rows)) == {"velocities"}


def test_the_spread_of_noise_is_found(tmp_path):
    """Errors of 0.1, 0.2 and 0.4 m forward, half of it to the left: all that can be learned is how large."""
    deviation_m = torch.tensor([[0.1, 0.05], [0.2, 0.1], [0.4, 0.2]])
    noise = torch.randn(360, 3, 2, generator=torch.Generator().manual_seed(0))
    data = noisy_walks(noise * deviation_m)
    network, curve = trained(WITH_SPREAD, data, tmp_path, steps=120, validate_every=60, clip_norm=1.0)
    outputs = roll(network, data, data.spans.rows)
    found = torch.diagonal(covariance_of(outputs["spread"]), dim1=-2, dim2=-1).mean(dim=0).sqrt()
    off = displacements(outputs["velocities"], data.future, data.dt_s).square().mean(dim=0).sqrt()
    torch.testing.assert_close(found, off, rtol=0.2, atol=0.0)
    assert curve[-1]["validation_nll"] < curve[0]["validation_nll"]


def test_an_unknown_uncertainty_is_named():
    with pytest.raises(ValueRuleError):
        parse_settings(plain_settings(MEAN_ONLY) | {"uncertainty": "cauchy"})
