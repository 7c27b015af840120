"""The encoder trained with the network: same inputs as with embeddings, and a gradient that reaches it."""

import dataclasses
from itertools import islice

import numpy as np
import pytest
import torch

from pedpred.networks import GridEncoder
from pedpred.training import TrainingSettings
from pedpred.training.distributed import ALONE
from pedpred.training.loop import train, train_step
from pedpred.training.variation import Variation, looked_up
from tests.exported import lstm, motion_data, same_weights
from tests.worlds import squares
from tools.end_to_end import Training

NETWORK = lstm(16, 16, {"state": (8, 8), "grid": (16, 8), "angular": (8, 8)}, uncertainty="gaussian")
QUICK = TrainingSettings(
    **{"steps": 4, "lanes": 4, "sub_sequence": 5, "longest_track": 8, "validate_every": 2},
    **{"lr": 1e-2, "warmup_steps": 1, "clip_norm": 1.0, "weight_decay": 0.0, "seed": 0},
    variation=Variation(map_swap=0.5, speed_scale=(0.7, 1.3), map_dropout=0.3),
)


@pytest.fixture
def training():
    """Six short tracks past squares; sub-sequences are padded, mirrored and without map at times."""
    rng = np.random.default_rng(0)
    rows = 6 * 12
    velocity = torch.from_numpy(rng.normal(1, 0.3, (rows, 2))).float()
    future = torch.from_numpy(rng.normal(1, 0.3, (rows, 4, 2))).float()
    motion = motion_data(velocity, future, 6)
    parts = motion.sequences[:4], motion.sequences[4:]
    return Training(NETWORK, motion, squares(rng, rows), parts, QUICK, ALONE)


def drawn():
    torch.manual_seed(1)
    return GridEncoder(60, 16)


def stepped(learner):
    """The loss of a training step, and the gradient of every weight that has one."""
    loss = train_step(learner, next(learner.batches(0)), 1)
    weights = learner.network.named_parameters()
    return loss, {name: weight.grad for name, weight in weights if weight.grad is not None}


def both_ways(training):
    """A learner that reads embeddings, and one that computes them; half precision lies between them."""
    return [training.learner(drawn(), trained) for trained in (False, True)]


def test_inputs_do_not_depend_on_whether_the_encoder_learns(training):
    """Those without map and with the map of the next lane, too."""
    frozen, live = both_ways(training)
    batches = list(islice(frozen.batches(0), 4))
    assert any(batch.mirrored.any() for batch in batches)
    assert any((batch.rows < 0).any() for batch in batches)
    for batch in batches:
        (expected, _), (found, _) = (looked_up(learner.data, batch) for learner in (frozen, live))
        assert found.keys() == expected.keys()
        assert expected["grid"].std(dim=(0, 1)).max() > 0.01
        for name, values in expected.items():
            torch.testing.assert_close(found[name], values, atol=1e-3, rtol=1e-3)


def test_a_step_with_an_encoder_that_gets_no_gradient_is_a_step_with_its_embeddings(training):
    frozen, live = both_ways(training)
    live.network.encoder.requires_grad_(False)
    (expected_loss, expected), (loss, found) = stepped(frozen), stepped(live)
    torch.testing.assert_close(loss, expected_loss, atol=1e-4, rtol=1e-3)
    assert found.keys() == expected.keys()
    assert expected["projections.grid.weight"].any()
    for name, gradient in expected.items():
        torch.testing.assert_close(found[name], gradient, atol=0.01 * float(abs(gradient).max()), rtol=0)
    assert same_weights(live.network.encoder, drawn())


def test_end_to_end_every_convolution_learns(training):
    learner = training.learner(drawn(), True)
    found = stepped(learner)[1]
    for name, weight in drawn().named_parameters():
        learnt = learner.network.encoder.get_parameter(name)
        if name.startswith("conv"):
            assert found[f"encoder.{name}"].any()
            assert not torch.equal(learnt, weight)
        else:  # the network's projection started as this layer and learns in its place
            assert torch.equal(learnt, weight)


def test_a_frozen_encoder_stays_as_it_is(training):
    encoder = drawn()
    train(training.learner(encoder, False), None, "toy")
    assert same_weights(encoder, drawn())


def test_the_encoder_that_is_kept_is_that_of_the_best_validation(training):
    """So the network and the encoder of a forecaster belong together."""
    learner = training.learner(drawn(), True)
    curve = train(learner, None, "toy")
    learner.network.eval()
    best = min(entry["validation_ade_m"] for entry in curve)
    assert learner.validate()["validation_ade_m"] == pytest.approx(best, rel=1e-5)


def test_validation_does_not_depend_on_whether_the_encoder_learns(training):
    frozen, live = (learner.validate() for learner in both_ways(training))
    assert live == pytest.approx(frozen, rel=1e-3)


def test_bfloat16_changes_little(training, narrow_lstm):
    narrow = dataclasses.replace(training, context=dataclasses.replace(ALONE, autocast=True))
    exact, rounded = (stepped(given.learner(drawn(), True))[0] for given in (training, narrow))
    torch.testing.assert_close(rounded, exact, atol=0.05, rtol=0.05)
