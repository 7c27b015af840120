"""Lanes, network and training: memory is carried, cut and resumed exactly."""

import dataclasses
import math
import sys
from importlib import import_module
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.datasets import stream_lanes
from pedpred.errors import InputError, ValueRuleError
from pedpred.models import ARCHITECTURES
from pedpred.models.contract import Loss, detach, mean_over, reset, velocity_distance
from pedpred.models.lstm.autoencoder import (
    GridAutoencoder,
    GridEncoder,
    intersection_over_union,
    read_autoencoder,
    reconstruction_loss,
)
from pedpred.models.lstm.encoding import encode, encode_once
from pedpred.models.registry import load_network, parse_settings, plain_settings
from pedpred.storage.checkpoints import load_weights, read_checkpoint
from pedpred.training import (
    AutoencoderLearner,
    AutoencoderSettings,
    SequenceSettings,
    train,
)
from pedpred.training.fit import copy_phase
from pedpred.training.loop import scratch_folder
from pedpred.training.schedule import learning_rate
from pedpred.training.sequences import run_over_sequences
from tests.exported import lstm, roll, rows_of, same_weights, train_on, write_autoencoder, write_network
from tests.worlds import squares

WIDTHS = {"state": 2, "angular": 72}
SMALL = lstm(16, 16, {"state": (8, 8), "angular": (8, 8)}, uncertainty="gaussian")
QUICK = SequenceSettings(
    **{"steps": 6, "lanes": 4, "sub_sequence": 5, "longest_track": 15, "validate_every": 3},
    **{"lr": 1e-2, "warmup_steps": 2, "clip_norm": 1.0, "weight_decay": 1e-4, "seed": 0},
    **{"validation_by": "track", "validation_share": 0.3},
)
SHORT = AutoencoderSettings(
    latent=16, batch=8, steps=60, validate_every=20, lr=2e-3, warmup_steps=5, clip_norm=100.0, seed=0
)


def toy_data(rng, tracks=6, length=20):
    """Tracks whose speed is told at the first step only: later targets need memory."""
    speed = torch.from_numpy(rng.choice([-1.0, 1.0], tracks)).float()
    velocity, future = torch.zeros(tracks, length, 2), torch.zeros(tracks, length, 4, 2)
    velocity[:, 0, 0] = speed
    future[..., 0] = speed[:, None, None]
    return rows_of(velocity.flatten(0, 1), future.flatten(0, 1), tracks)


@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.integers(1, 7))
def test_lanes_stream_every_row_once_a_pass_in_order(seed, lanes, length):
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 40, 9)
    edges = np.concatenate([[0], np.cumsum(lengths)])
    sequences = np.stack([edges[:-1], edges[1:]], axis=-1)
    seen = []
    ends = [-2] * lanes
    for batch in stream_lanes(sequences, lanes, length, 1000, rng):
        for lane, (rows, start) in enumerate(zip(batch.rows, batch.starts, strict=True)):
            real = rows[rows >= 0]
            assert (np.diff(real) == 1).all()
            assert start == (real[0] in edges)
            assert start or real[0] == ends[lane] + 1
            ends[lane] = real[-1]
            seen.extend(real)
        if len(seen) >= 3 * edges[-1]:
            break
    counts = np.bincount(seen, minlength=edges[-1])
    assert counts.min() >= 1
    assert counts.max() - counts.min() <= 2 + lanes


def test_long_tracks_are_cut_but_nothing_is_lost():
    stream = stream_lanes(np.array([[0, 50]]), 1, 5, 12, np.random.default_rng(0))
    seen, starts = [], 0
    while len(seen) < 50:
        batch = next(stream)
        seen += batch.rows[batch.rows >= 0].tolist()
        starts += int(batch.starts[0])
    assert sorted(seen) == list(range(50))
    assert starts >= 5


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(1, 11))
def test_chunked_forward_equals_one_long_forward(seed, cut):
    torch.manual_seed(seed)
    network = SMALL.build(WIDTHS, 4).eval()
    inputs = {"state": torch.randn(3, 12, 2), "angular": torch.rand(3, 12, 72)}
    whole, _ = network(inputs, network.start(3))
    first, state = network({k: v[:, :cut] for k, v in inputs.items()}, network.start(3))
    second, _ = network({k: v[:, cut:] for k, v in inputs.items()}, detach(state))
    for name, values in whole.items():
        torch.testing.assert_close(torch.cat([first[name], second[name]], 1), values, atol=1e-5, rtol=1e-4)


def test_reset_forgets_the_starting_lanes_only():
    network = SMALL.build(WIDTHS, 4).eval()
    inputs = {"state": torch.randn(2, 3, 2), "angular": torch.rand(2, 3, 72)}
    _, state = network(inputs, network.start(2))
    after = reset(state, torch.tensor([True, False]))
    for name, value in after.items():
        assert not value[0].any()
        assert torch.equal(value[1], state[name][1])


def test_no_gradient_flows_into_the_sub_sequence_before():
    network = SMALL.build(WIDTHS, 4)
    first = {"state": torch.randn(1, 3, 2, requires_grad=True), "angular": torch.rand(1, 3, 72)}
    _, state = network(first, network.start(1))
    second, _ = network({"state": torch.randn(1, 3, 2), "angular": torch.rand(1, 3, 72)}, detach(state))
    sum(values.sum() for values in second.values()).backward()
    assert first["state"].grad is None


def test_rolling_whole_tracks_does_not_depend_on_their_company():
    data = toy_data(np.random.default_rng(0))
    network = SMALL.build(WIDTHS, 4).eval()
    together, alone = roll(network, data, data.spans.rows), roll(network, data, data.spans.rows[2:3])
    for name, values in together.items():
        torch.testing.assert_close(values[40:60], alone[name][40:60], atol=1e-5, rtol=1e-4)
        assert not alone[name][:40].any()


def test_rolling_block_by_block_tells_every_row_once(monkeypatch):
    data = toy_data(np.random.default_rng(0))
    network = SMALL.build(WIDTHS, 4).eval()
    whole = roll(network, data, data.spans.rows)
    monkeypatch.setattr("pedpred.training.sequences._TRACKS_AT_ONCE", 4)
    monkeypatch.setattr("pedpred.training.sequences._STEPS_AT_ONCE", 7)
    blocks = list(run_over_sequences(network, data, data.spans.rows[1:]))
    assert max(len(rows) for rows, _ in blocks) == 4 * 7
    rows = torch.cat([rows for rows, _ in blocks])
    assert sorted(rows.tolist()) == list(range(20, 120))
    for name, values in whole.items():
        together = torch.cat([outputs[name] for _, outputs in blocks])
        torch.testing.assert_close(together, values[rows], atol=1e-5, rtol=1e-4)


def test_padding_counts_neither_in_loss_nor_in_gradient():
    data = toy_data(np.random.default_rng(0))
    network = SMALL.build(WIDTHS, 4)
    rows = torch.tensor([[0, 1, 2], [20, 21, 22]])
    padded = torch.cat([rows, torch.full((2, 4), -1)], dim=1)
    losses = []
    for chosen in (rows, padded):
        outputs, _ = network(data.inputs(chosen), network.start(2))
        future, known = data.future[chosen.clamp(min=0)], data.known(chosen)
        losses += network.loss(outputs, future, known, data.dt_s)
    torch.testing.assert_close(losses[:3], losses[3:])


def test_unknown_futures_do_not_count():
    predicted, truth = torch.zeros(1, 4, 2), torch.zeros(1, 4, 2)
    truth[0, :, 0] = torch.tensor([3.0, 3.0, 100.0, 100.0])
    known = torch.tensor([[True, True, False, False]])
    assert mean_over(velocity_distance(predicted, truth), known).item() == pytest.approx(3.0)


def test_carried_memory_solves_what_one_sub_sequence_cannot(tmp_path):
    """The direction is shown at the first of 20 steps, sub-sequences have 5: only memory knows it."""
    torch.manual_seed(0)
    data = toy_data(np.random.default_rng(1), tracks=24)
    network = SMALL.build(WIDTHS, 4)
    long = dataclasses.replace(QUICK, steps=250, lanes=12, longest_track=100, validate_every=50)
    train(train_on(network, data, data.spans.rows, data.spans.rows, long), tmp_path, "memory")
    late = [row for first, last in data.spans.rows for row in range(first + 10, last)]
    found = roll(network.eval(), data, data.spans.rows)["velocities"]
    error = velocity_distance(found[late], data.future[late])
    assert error.mean() < 0.2  # without memory nothing beats an error of 1 m/s


def test_a_killed_training_ends_with_the_same_weights(tmp_path, monkeypatch):
    data = toy_data(np.random.default_rng(2))

    def run(scratch):
        torch.manual_seed(3)
        network = SMALL.build(WIDTHS, 4)
        learner = train_on(network, data, data.spans.rows[:4], data.spans.rows[4:], QUICK)
        return network.state_dict(), train(learner, scratch, "toy")

    whole, curve = run(tmp_path / "whole")
    import pedpred.training.loop as loop

    def killed(*arguments):
        save(*arguments)
        raise KeyboardInterrupt

    save = loop.save_progress
    monkeypatch.setattr(loop, "save_progress", killed)
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "killed")
    monkeypatch.setattr(loop, "save_progress", save)
    resumed, resumed_curve = run(tmp_path / "killed")
    for name, weight in whole.items():
        torch.testing.assert_close(resumed[name], weight, rtol=0, atol=0)
    assert [r["step"] for r in curve] == [r["step"] for r in resumed_curve]


def test_validation_data_without_a_whole_horizon_are_refused_at_once(tmp_path):
    data = toy_data(np.random.default_rng(0))
    data.future_steps[:] = 3  # of 4
    learner = train_on(SMALL.build(WIDTHS, 4), data, data.spans.rows, data.spans.rows, QUICK)
    with pytest.raises(ValueRuleError, match="validation_ade_m = nan, but the validation data"):
        train(learner, tmp_path, "toy")


@pytest.mark.parametrize(("lost", "named"), [("loss", "train_loss"), ("weights", "validation_")])
def test_a_training_that_diverges_is_an_error_and_leaves_nothing(lost, named, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = toy_data(np.random.default_rng(0))
    learner = train_on(SMALL.build(WIDTHS, 4), data, data.spans.rows[:4], data.spans.rows[4:], QUICK)
    loss_of = learner.loss

    def lose(batch, step):
        found = loss_of(batch, step)
        if step == 4 and lost == "loss":
            return Loss(found.total * math.inf, found.reported * math.inf, found.weight)
        if step == 5:
            learner.clip = lambda: [p.grad.fill_(math.nan) for p in learner.network.parameters()]
        return found

    learner.loss = lose
    with (
        pytest.raises(ValueRuleError, match=rf"lr = 0\.01, but {named}.* is not finite after 6 steps"),
        scratch_folder({"toy": lost}) as scratch,
    ):
        train(learner, scratch, "toy")
    assert not scratch.exists()


def train_autoencoder(training, validation, settings, scratch=None):
    learner = AutoencoderLearner(training, validation, 60, settings)
    return learner.network, train(learner, scratch, "toy")


def test_a_killed_pre_training_ends_with_the_same_weights(tmp_path, monkeypatch):
    packed = np.random.default_rng(0).integers(0, 255, (8, 450), dtype=np.uint8)
    changed = {"latent": 4, "batch": 2, "steps": 3, "validate_every": 1, "lr": 1e-3, "warmup_steps": 1}
    short = dataclasses.replace(SHORT, **changed, clip_norm=1.0)
    whole, curve = train_autoencoder(packed, packed, short)
    validate = AutoencoderLearner.validate
    found = iter([validate] * 3)  # untrained and after two steps
    monkeypatch.setattr(AutoencoderLearner, "validate", lambda learner: next(found)(learner))
    with pytest.raises(StopIteration):
        train_autoencoder(packed, packed, short, tmp_path)
    monkeypatch.setattr(AutoencoderLearner, "validate", validate)
    resumed, resumed_curve = train_autoencoder(packed, packed, short, tmp_path)
    assert same_weights(whole, resumed)
    assert resumed_curve[1:] == curve[1:]  # [0] has no loss yet, and nan equals nothing


def test_a_phase_without_places_copies_the_network(tmp_path):
    write_network(tmp_path / "main", SMALL.build(WIDTHS, 4))
    copy_phase(tmp_path / "main", tmp_path / "fold", tmp_path / "curve.tsv")
    for name in ("weights.safetensors", "about.json"):
        assert (tmp_path / "fold" / name).read_bytes() == (tmp_path / "main" / name).read_bytes()
    assert (tmp_path / "curve.tsv").read_text() == "epoch\tstep\ttrain_loss\n"


def test_chance_holds_along_a_track_and_changes_with_it():
    sequences = np.array([[0, 20], [20, 33], [33, 60]])
    stream = stream_lanes(sequences, 2, 5, 1000, np.random.default_rng(0))
    before = next(stream)
    for batch in islice(stream, 40):
        held = (batch.chance == before.chance).all(axis=1)
        assert (held == ~batch.starts).all()
        before = batch


def test_unknown_channel_is_named():
    plain = plain_settings(SMALL) | {"channels": {"smell": {"projection": 1, "lstm": 1}}}
    with pytest.raises(ValueRuleError, match="smell"):
        parse_settings(plain)
    with pytest.raises(ValueRuleError, match=r"architecture = 'gru'.*lstm"):
        parse_settings(plain_settings(SMALL) | {"architecture": "gru"})


def test_a_class_that_a_package_exports_again_is_the_same_architecture(monkeypatch):
    package = SimpleNamespace(**vars(import_module("pedpred.models.lstm.network")))
    monkeypatch.setitem(sys.modules, "package", package)
    monkeypatch.setitem(
        ARCHITECTURES, "lstm", ARCHITECTURES["lstm"]._replace(settings="package.LstmSettings")
    )
    assert plain_settings(SMALL)["architecture"] == "lstm"


def test_checkpoint_round_trip_and_damage(tmp_path):
    network = SMALL.build(WIDTHS, 4)
    write_network(tmp_path, network)
    weights, _ = read_checkpoint(tmp_path)
    other = load_network(tmp_path)
    assert other.settings == SMALL
    assert same_weights(network, other)
    wider = dataclasses.replace(SMALL, joint=17).build(WIDTHS, 4)
    with pytest.raises(InputError, match="weights"):
        load_weights(wider, weights, tmp_path)
    (tmp_path / "weights.safetensors").write_bytes(b"\x08")
    with pytest.raises(InputError, match=r"weights\.safetensors"):
        read_checkpoint(tmp_path)


def test_decoder_uses_the_encoders_weights():
    network = GridAutoencoder(60)
    names = {name for name, _ in network.named_parameters()}
    assert {n for n in names if "encoder" not in n} == {"embedding_bias", "bias1", "bias2", "bias3"}
    crops = (torch.rand(2, 60, 60) > 0.8).float()
    assert network(crops).shape == crops.shape
    before = network(crops)
    with torch.no_grad():
        network.encoder.conv1.weight.zero_()
    assert not torch.equal(network(crops), before)
    assert (network(crops) == 0).all()  # its last layer is the encoder's first
    assert network.encoder.embedding(crops).shape == (2, 392)
    assert reconstruction_loss(crops, crops).item() == 0
    assert intersection_over_union(crops, crops) == 1
    assert intersection_over_union(crops, 1 - crops) == 0


@pytest.mark.parametrize("tied", [True, False])
def test_an_auto_encoder_on_disk_knows_whether_it_is_tied(tmp_path, tied):
    network, crops = write_autoencoder(tmp_path, 4, tied), (torch.rand(2, 60, 60) > 0.8).float()
    other, cells = read_autoencoder(tmp_path)
    assert cells == 60
    assert torch.equal(other(crops), network(crops))
    with torch.no_grad():
        other.encoder.conv1.weight.zero_()
    assert bool((other(crops) == 0).all()) == tied


@settings(deadline=None, max_examples=20)
@given(st.lists(st.integers(0, 5), max_size=30))
def test_a_crop_has_the_same_embedding_whatever_it_is_encoded_with(which):
    encoder = GridEncoder(16)
    different = np.random.default_rng(0).integers(0, 256, (6, 2 * 32), dtype=np.uint8)[
        :, ::2
    ]  # not contiguous
    alone = np.concatenate([encode(encoder, crop[None]) for crop in different])
    np.testing.assert_allclose(encode_once(encoder, different[which]), alone[which], rtol=1e-5, atol=1e-6)


def test_autoencoder_learns_and_repeats():
    packed = squares(np.random.default_rng(0), 64)
    network, curve = train_autoencoder(packed, packed[:32], SHORT)
    assert curve[-1]["validation_loss"] < 0.8 * curve[0]["validation_loss"]
    again, _ = train_autoencoder(packed, packed[:32], SHORT)
    assert same_weights(network, again)


def test_learning_rate_rises_then_falls():
    rates = [learning_rate(step, 100, 1.0, 10) for step in range(100)]
    assert np.argmax(rates) in (9, 10)
    assert rates[0] == pytest.approx(0.1)
    assert rates[-1] < 0.02
    assert (np.diff(rates[10:]) < 0).all()
