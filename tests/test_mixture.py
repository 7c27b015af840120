"""Laws of a network without memory, online, whatever its weights are."""

import dataclasses

import numpy as np
import pytest
import torch

from pedpred.evaluation.windows import find_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.models.mixture.features.nearest import NEIGHBOUR
from pedpred.models.mixture.network import SURROUNDINGS
from pedpred.models.registry import parse_settings
from pedpred.online import OnlinePredictor
from tests.exported import MIXTURE_ROWS, TRACKER, forecaster_of, widths_of
from tests.refused import refused
from tests.worlds import walled_scene

WIDTHS = widths_of(MIXTURE_ROWS.features)


@pytest.mark.parametrize("age", [4, 40, 400])
def test_an_old_track_is_forecast_as_a_young_one(mixture, age):
    """Somebody who walks straight, first seen some time ago."""
    robot = OnlinePredictor.load(mixture[0])
    for k in range(age + 20):
        forecast = robot.update(0.4 * k, np.array([7]), np.array([[0.5 * k, 0.0]]))
        if k == 23:
            young = forecast.position - [0.5 * k, 0.0]
    np.testing.assert_allclose(forecast.position - [0.5 * k, 0.0], young, atol=5e-3)


def test_an_untrained_network_continues_the_tracked_motion():
    network = parse_settings({"architecture": "mixture"}).build(WIDTHS, 10)
    inputs = {name: torch.rand(3, 1, width) for name, width in WIDTHS.items()}
    outputs, _ = network(inputs, {})
    expected = inputs["state"][:, :, None].expand(-1, -1, 10, -1)
    torch.testing.assert_close(outputs["velocities"], expected)


@pytest.mark.parametrize("unread", SURROUNDINGS)
def test_what_is_left_unread_changes_nothing(unread):
    torch.manual_seed(0)
    about = {"architecture": "mixture", "units": 32, "unread": [unread]}
    inputs = {name: torch.rand(6, 2, width) for name, width in WIDTHS.items()}
    others = inputs | {unread: torch.rand_like(inputs[unread])}
    for own, same in ((about, True), (about | {"unread": []}, False)):
        network = parse_settings(own).build(WIDTHS, 10)
        one, other = (network(seen, {})[0]["modes"] for seen in (inputs, others))
        assert torch.equal(one, other) == same


def test_unread_velocities_of_neighbours_change_nothing():
    torch.manual_seed(0)
    about = {"architecture": "mixture", "units": 32, "unread": ["neighbour_velocities"]}
    network = parse_settings(about).build(WIDTHS, 10)
    inputs = {name: torch.rand(6, 2, width) for name, width in WIDTHS.items()}
    moved = inputs["neighbours"].unflatten(-1, (-1, NEIGHBOUR)).repeat(3, 1, 1, 1, 1)
    moved[1, ..., 2:4] += 1.0
    moved[2, ..., :2] += 1.0
    one, faster, elsewhere = (network(inputs | {"neighbours": m.flatten(-2)}, {})[0]["modes"] for m in moved)
    assert torch.equal(one, faster)
    assert not torch.equal(one, elsewhere)


def test_people_who_choose_alone_keep_their_weights(mixture):
    scene = walled_scene(np.random.default_rng(1), 0.3, tracks=20, detections=15)
    request = find_windows(scene, Perception(TRACKER, 0.2), ForecastProtocol()).request
    request = dataclasses.replace(request, rows=np.arange(len(request.table)))
    together, alone = (forecaster_of(*mixture[1:], together=choice)(request) for choice in (True, False))
    np.testing.assert_array_equal(together.point, alone.point)
    assert (together.weight != alone.weight).any()
    np.testing.assert_array_equal(np.sort(together.path[..., -1, 0]), np.sort(alone.path[..., -1, 0]))


def test_without_the_mirror_image_a_network_looks_once():
    own = {"architecture": "mixture", "units": 32, "modes": 3, "mirrored": False}
    network = parse_settings(own).build(WIDTHS, 10)
    inputs = {name: torch.rand(6, 2, width) for name, width in WIDTHS.items()}
    assert network(inputs, {})[0]["modes"].shape == (6, 2, 3, 10, 2)


@pytest.mark.parametrize("wrong", [{"modes": 3}, {"unread": ["state"]}, {"frozen": ["heads"]}])
def test_settings_that_make_no_sense_are_named(wrong):
    with refused(next(iter(wrong))):
        parse_settings({"architecture": "mixture"} | wrong)


def test_gradients_reach_every_weight_from_known_steps_only():
    torch.manual_seed(0)
    network = parse_settings({"architecture": "mixture", "units": 32}).build(WIDTHS, 10)
    torch.nn.init.normal_(network.heads["velocities"].weight, std=0.1)
    inputs = {name: torch.rand(6, 2, width) for name, width in WIDTHS.items()}
    future, known = torch.randn(6, 2, 10, 2), torch.ones(6, 2, 10, dtype=torch.bool)
    known[0, 0, 4:] = False
    known[1] = False
    future.requires_grad_()
    network.loss(network(inputs, {})[0], future, known, 0.3).total.backward()
    assert all(weight.grad.abs().sum() > 0 for weight in network.parameters())
    assert not future.grad[~known].any()
    assert future.grad[known].abs().sum() > 0
