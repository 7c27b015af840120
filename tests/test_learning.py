"""Training: memory is carried, a run is resumed exactly, and what cannot be learned is an error."""

import dataclasses
import math

import numpy as np
import pytest
import torch

from pedpred.datasets.rows import load_rows
from pedpred.errors import InputError, ValueRuleError
from pedpred.models.contract import Loss, velocity_distance
from pedpred.models.registry import parse_settings, plain_settings
from pedpred.rows.files import write_manifest
from pedpred.storage.checkpoints import load_weights, read_checkpoint
from pedpred.training import AutoencoderLearner, AutoencoderSettings, loop, train
from pedpred.training.fit import copy_phase
from pedpred.training.progress import scratch_folder
from tests.exported import roll, same_weights, train_on, widths_of, write_network
from tests.refused import refused, unread
from tests.trainings import (
    INSTANTS,
    MADE_WITH,
    MIXTURE,
    QUICK,
    SIZES,
    SMALL,
    STEPS,
    WIDTHS,
    toy_data,
    write_situations,
)

CODED = AutoencoderSettings(
    latent=4, batch=2, steps=6, validate_every=3, lr=1e-3, warmup_steps=1, clip_norm=1.0, seed=0
)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    return write_situations(tmp_path_factory.mktemp("situations"))


def of_sequences(_):
    torch.manual_seed(3)
    data = toy_data(np.random.default_rng(2))
    return train_on(SMALL.build(WIDTHS, 4), data, data.spans.rows[:4], data.spans.rows[4:], QUICK)


def of_instants(folders, how=INSTANTS):
    torch.manual_seed(0)
    return how.learner(MIXTURE.build(widths_of(SIZES), STEPS), load_rows(folders))


def of_crops(_):
    packed = np.random.default_rng(0).integers(0, 255, (8, 450), dtype=np.uint8)
    return AutoencoderLearner(packed, packed, 60, CODED)


@pytest.mark.parametrize("make", [of_sequences, of_instants, of_crops])
def test_a_killed_training_ends_with_the_same_weights(make, folders, tmp_path, monkeypatch):
    whole, killed, resumed = (make(folders) for _ in range(3))
    curve = train(whole, None, "toy")
    save = loop.save_progress

    def end(*arguments):
        save(*arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr(loop, "save_progress", end)
    with pytest.raises(KeyboardInterrupt):
        train(killed, tmp_path, "toy")
    monkeypatch.setattr(loop, "save_progress", save)
    assert train(resumed, tmp_path, "toy")[1:] == curve[1:]  # [0] has no loss yet, and nan equals nothing
    assert same_weights(whole.network, resumed.network)


def test_memory_solves_what_one_sub_sequence_cannot():
    """The direction is shown at the first of 20 steps, sub-sequences have 5: only memory knows it."""
    torch.manual_seed(0)
    data = toy_data(np.random.default_rng(1), tracks=24)
    network = SMALL.build(WIDTHS, 4)
    long = dataclasses.replace(QUICK, steps=250, lanes=12, longest_track=100, validate_every=250)
    train(train_on(network, data, data.spans.rows, data.spans.rows, long), None, "memory")
    late = [row for first, last in data.spans.rows for row in range(first + 10, last)]
    found = roll(network.eval(), data, data.spans.rows)["velocities"]
    assert velocity_distance(found[late], data.future[late]).mean() < 0.2  # 1 m/s without memory


def test_a_network_learns_what_obstacles_mean(folders):
    taught = of_instants(folders, dataclasses.replace(INSTANTS, steps=100, validate_every=100))
    before, after = train(taught, None, "learn")
    assert after["validation_ade_m"] < 0.7 * before["validation_ade_m"]


def test_validation_without_a_whole_horizon_is_refused():
    learner = of_sequences(None)
    learner.data.future_steps[:] = 3  # of 4
    with refused("validation_ade_m"):
        train(learner, None, "toy")


def test_a_training_that_diverges_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    learner = of_sequences(None)
    loss_of = learner.loss

    def lose(batch, step):
        found = loss_of(batch, step)
        return Loss(found.total * math.inf, found.reported * math.inf, found.weight) if step == 4 else found

    learner.loss = lose
    with refused("lr"), scratch_folder({"toy": "lost"}) as scratch:
        train(learner, scratch, "toy")
    assert not scratch.exists()


# Rows and checkpoints


def test_rows_of_sets_have_the_same_sizes(folders, tmp_path):
    fewer = dataclasses.replace(MADE_WITH, features=dataclasses.replace(SIZES, beams=8))
    write_manifest(tmp_path, fewer, {})
    with pytest.raises(ValueRuleError):
        load_rows({"a": folders["a"], "other": tmp_path})


def test_a_phase_without_places_copies_the_network(tmp_path):
    write_network(tmp_path / "main", SMALL.build(WIDTHS, 4))
    copy_phase(tmp_path / "main", tmp_path / "fold", tmp_path / "curve.tsv")
    for name in ("weights.safetensors", "about.json"):
        assert (tmp_path / "fold" / name).read_bytes() == (tmp_path / "main" / name).read_bytes()
    assert (tmp_path / "curve.tsv").read_text() == "epoch\tstep\ttrain_loss\n"


@pytest.mark.parametrize(
    ("settings", "field", "value"),
    [
        (plain_settings(SMALL), "channels", {"smell": {"projection": 1, "lstm": 1}}),
        (plain_settings(SMALL), "architecture", "gru"),
        (plain_settings(SMALL), "uncertainty", "cauchy"),
        ({"architecture": "mixture"}, "modes", 3),
        ({"architecture": "mixture"}, "unread", ["state"]),
        ({"architecture": "mixture"}, "frozen", ["heads"]),
    ],
)
def test_settings_of_a_network_that_cannot_be_are_named(settings, field, value):
    with refused(field):
        parse_settings(settings | {field: value})


def test_a_checkpoint_that_does_not_fit_or_is_damaged_is_refused(tmp_path):
    write_network(tmp_path, SMALL.build(WIDTHS, 4))
    weights, _ = read_checkpoint(tmp_path)
    wider = dataclasses.replace(SMALL, joint=17).build(WIDTHS, 4)
    with pytest.raises(InputError):
        load_weights(wider, weights, tmp_path)
    (tmp_path / "weights.safetensors").write_bytes(b"\x08")
    with unread(tmp_path / "weights.safetensors"):
        read_checkpoint(tmp_path)
