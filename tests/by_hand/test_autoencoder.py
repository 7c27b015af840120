"""The auto-encoder beside convolutions in plain numpy: loss (eq. 4), tied weights, pre-training."""

from itertools import islice

import numpy as np
import pytest
import torch

from pedpred.errors import InputError
from pedpred.models.lstm.autoencoder import (
    GridAutoencoder,
    GridEncoder,
    intersection_over_union,
    read_autoencoder,
    reconstruction_loss,
)
from pedpred.models.lstm.encoding import encode, encode_once, load_encoder
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.training import AutoencoderLearner, AutoencoderSettings

CONVOLUTIONS = (("conv1", 0), ("conv2", 1), ("conv3", 1))
"""Kernels of 5, 3 and 3 cells; names and paddings."""
TIED = ("conv1", "conv2", "conv3", "fc")
SETTINGS = AutoencoderSettings(
    latent=3, batch=5, steps=4, validate_every=2, lr=0.013, warmup_steps=0, clip_norm=2.5, seed=11
)


def convolved(x, weight, bias, padding):
    """y(o, i, j) = b(o) + sum w(o, c, a, b) x(c, 2 i + a - p, 2 j + b - p)."""
    x = np.pad(x, [(0, 0), (0, 0), (padding, padding), (padding, padding)])
    side, kernel = (x.shape[-1] - weight.shape[-1]) // 2 + 1, weight.shape[-1]
    y = np.zeros((len(x), len(weight), side, side)) + bias[:, None, None]
    for a, b in np.ndindex(kernel, kernel):
        part = x[:, :, a : a + 2 * side - 1 : 2, b : b + 2 * side - 1 : 2]
        y += np.einsum("oc,ncij->noij", weight[..., a, b], part)
    return y


def transposed(y, weight, bias, padding, cells):
    """x(c, 2 i + a - p, 2 j + b - p) = b(c) + the sum of w(o, c, a, b) y(o, i, j) that fall on this cell."""
    side, kernel = y.shape[-1], weight.shape[-1]
    x = np.zeros((len(y), weight.shape[1], cells + 2 * padding + 1, cells + 2 * padding + 1))
    for a, b in np.ndindex(kernel, kernel):
        part = np.einsum("oc,noij->ncij", weight[..., a, b], y)
        x[:, :, a : a + 2 * side - 1 : 2, b : b + 2 * side - 1 : 2] += part
    return x[..., padding : padding + cells, padding : padding + cells] + bias[:, None, None]


def weights_of(network):
    return {name: weights.detach().numpy() for name, weights in network.named_parameters()}


def embedded(w, crops, prefix="encoder."):
    hidden = crops[:, None]
    for name, padding in CONVOLUTIONS:
        weight, bias = w[f"{prefix}{name}.weight"], w[f"{prefix}{name}.bias"]
        hidden = np.maximum(convolved(hidden, weight, bias, padding), 0)
    return hidden.reshape(len(crops), -1)


def reconstructed(w, crops, sides, tied=True):
    """Figure 3 of the paper; tied, the decoder has the encoder's weights."""
    decoder = {name: w[f"encoder.{name}.weight" if tied else f"decoder.{name}"] for name in TIED}
    latent = embedded(w, crops) @ w["encoder.fc.weight"].T + w["encoder.fc.bias"]
    hidden = np.maximum(latent @ decoder["fc"] + w["embedding_bias"], 0)
    hidden = hidden.reshape(len(crops), 8, sides[3], sides[3])
    hidden = np.maximum(transposed(hidden, decoder["conv3"], w["bias3"], 1, sides[2]), 0)
    hidden = np.maximum(transposed(hidden, decoder["conv2"], w["bias2"], 1, sides[1]), 0)
    return transposed(hidden, decoder["conv1"], w["bias1"], 0, sides[0])[:, 0]


def built(cells, tied=True):
    """Large random weights and biases in double precision."""
    torch.manual_seed(2)
    network = GridAutoencoder(cells, 3, tied).double()
    with torch.no_grad():
        for name, weights in network.named_parameters():
            spread = 0.3 if weights.dim() == 1 else 2.0 / np.sqrt(weights[0].numel())
            weights.normal_(std=spread * (0.5 if name.startswith("decoder") else 1.0))
    return network


def some_crops(cells, count=2):
    return (np.random.default_rng(cells).random((count, cells, cells)) < 0.4).astype(float)


@pytest.mark.parametrize(
    ("cells", "sides"), [(12, [12, 4, 2, 1]), (15, [15, 6, 3, 2]), (60, [60, 28, 14, 7])]
)
@pytest.mark.parametrize("tied", [True, False])
def test_crops_are_encoded_and_decoded_as_by_hand(cells, sides, tied):
    """A side becomes floor((side + 2 p - kernel) / 2) + 1; the decoder goes back to the same sides."""
    network, crops = built(cells, tied), some_crops(cells)
    assert network.encoder.sides == sides
    w = weights_of(network)
    code = embedded(w, crops)
    assert (code > 0).any()
    np.testing.assert_allclose(network.encoder.embedding(torch.from_numpy(crops)).detach(), code, atol=1e-10)
    latent = code @ w["encoder.fc.weight"].T + w["encoder.fc.bias"]
    np.testing.assert_allclose(network.encoder(torch.from_numpy(crops)).detach(), latent, atol=1e-10)
    found, expected = network(torch.from_numpy(crops)).detach(), reconstructed(w, crops, sides, tied)
    assert np.std(expected) > 0.1
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_decoder_of_its_own_has_other_weights():
    network = built(12, tied=False)
    assert set(network.decoder) == set(TIED)
    for name, weights in network.decoder.items():
        own = network.encoder.get_parameter(f"{name}.weight")
        assert weights.shape == own.shape
        assert not torch.equal(weights, own)
    assert not len(built(12).decoder)


def test_new_decoder_has_no_biases_and_paper_widths():
    network = GridAutoencoder(60)
    assert [tuple(network.encoder.get_parameter(f"{n}.weight").shape) for n in TIED] == [
        (64, 1, 5, 5), (32, 64, 3, 3), (8, 32, 3, 3), (64, 392),
    ]  # fmt: skip
    shapes = {"embedding_bias": (392,), "bias3": (32,), "bias2": (64,), "bias1": (1,)}
    for name, shape in shapes.items():
        assert tuple(network.get_parameter(name).shape) == shape
        assert not network.get_parameter(name).any()


def test_tied_weights_learn_at_both_ends():
    """Their gradients are the sums of those of an encoder and a decoder with the same weights."""
    tied, apart, crops = built(12), built(12, tied=False), torch.from_numpy(some_crops(12, 3))
    apart.load_state_dict(tied.state_dict(), strict=False)
    for name, weights in apart.decoder.items():
        weights.data = tied.encoder.get_parameter(f"{name}.weight").detach().clone()
    for network in (tied, apart):
        reconstruction_loss(crops, network(crops)).backward()
    for name, weights in apart.decoder.items():
        found, encoder = (one.encoder.get_parameter(f"{name}.weight").grad for one in (tied, apart))
        assert weights.grad.abs().max() > 0.1
        torch.testing.assert_close(found, encoder + weights.grad)


def test_reconstruction_loss_sums_cells_and_averages_crops():
    """Eq. 4, sum of squared errors of a crop: (1 + 4 + 0.25 + 0 + 0 + 9 = 14.25) and 0.5; mean 7.375.

    The gradient of a cell is 2 (output - input) / 2 crops.
    """
    crops = torch.tensor([[[1.0, 0.0, 1.0], [0.0, 0.0, 1.0]], [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]])
    off = torch.tensor([[[1.0, -2.0, 0.5], [0.0, 0.0, 3.0]], [[0.5, 0.0, 0.0], [0.0, -0.5, 0.0]]])
    output = (crops + off).requires_grad_()
    found = reconstruction_loss(crops, output)
    assert found.item() == pytest.approx(7.375)
    found.backward()
    np.testing.assert_allclose(output.grad, off)


def test_agreement_is_that_of_cells_above_one_half():
    """Both occupied: 2 cells of 2 crops; one of them: 5. Exactly 1/2 is free."""
    truth = torch.tensor([[[0.52, 1.0, 0.0]], [[1.0, 0.5, 1.0]]])
    guess = torch.tensor([[[0.51, 0.5, 0.9]], [[3.0, -4.0, 0.4]]])
    found = intersection_over_union(truth, guess)
    assert isinstance(found, float)
    assert found == pytest.approx(2 / 5)
    assert intersection_over_union(0 * truth, 0 * truth) == 1.0
    assert intersection_over_union(0 * truth, truth) == 0.0


def packed_crops(count, cells=16):
    return np.random.default_rng(7).integers(0, 256, (count, cells**2 // 8), dtype=np.uint8)


def test_every_crop_is_encoded_also_behind_the_first_batch():
    torch.manual_seed(0)
    encoder, packed = GridEncoder(16, 3), packed_crops(19)
    cells = np.unpackbits(packed, axis=-1, bitorder="little").reshape(-1, 16, 16).astype(float)
    expected = embedded(weights_of(encoder), cells, "")
    assert (expected > 0).any(axis=1).all()
    found = encode(encoder, packed)
    assert (found.dtype, found.shape) == (np.float32, (19, 32))
    np.testing.assert_allclose(found, expected, atol=1e-5)
    which = [4, 0, 18, 4, 4, 9, 0]
    np.testing.assert_allclose(encode_once(encoder, packed[which]), expected[which], atol=1e-5)


@pytest.mark.parametrize("tied", [True, False])
def test_a_stored_auto_encoder_is_read_with_its_sizes(tmp_path, tied):
    network = GridAutoencoder(12, 5, tied)
    write_checkpoint(tmp_path, network.state_dict(), {"cells": 12, "settings": {"latent": 5}})
    other = read_autoencoder(tmp_path)
    cells = other.encoder.sides[0]
    encoder = load_encoder(tmp_path)
    assert cells == encoder.sides[0] == 12
    assert (other.encoder.fc.out_features, encoder.fc.out_features) == (5, 5)
    assert other.state_dict().keys() == network.state_dict().keys()
    for name, weights in network.named_parameters():
        assert torch.equal(weights, other.get_parameter(name))
        if name.startswith("encoder."):
            assert torch.equal(weights, encoder.get_parameter(name.removeprefix("encoder.")))
    write_checkpoint(tmp_path, network.state_dict(), {"cells": 12})
    for read in (read_autoencoder, load_encoder):
        with pytest.raises(InputError, match=r"about\.json"):
            read(tmp_path)


def learner(**changes):
    settings = AutoencoderSettings(**vars(SETTINGS) | changes)
    return AutoencoderLearner(packed_crops(23), packed_crops(30)[11:], 16, settings)


def unpacked(packed):
    return np.unpackbits(packed, axis=-1, bitorder="little").reshape(-1, 16, 16).astype(float)


def test_batches_are_sorted_draws_and_continue():
    """Batch k is the k-th draw of 5 among 23 rows, whatever was done before."""
    rng = np.random.default_rng(11)
    expected = [np.sort(rng.integers(0, 23, 5)).tolist() for _ in range(6)]
    assert [rows.tolist() for rows in islice(learner().batches(0), 6)] == expected
    assert [rows.tolist() for rows in islice(learner().batches(2), 4)] == expected[2:]


def test_validation_is_over_all_crops_of_19():
    one = learner()
    with (
        torch.no_grad()
    ):  # so that about half of the cells are reconstructed as occupied, unlike in each crop
        for weights in one.network.parameters():
            weights.normal_(std=2.0 / np.sqrt(weights[0].numel()) if weights.dim() > 1 else 0.4)
    crops = unpacked(packed_crops(30)[11:])
    guess = reconstructed(weights_of(one.network), crops, [16, 6, 3, 2])
    found = one.validate()
    assert found["validation_loss"] == pytest.approx(((crops - guess) ** 2).sum(axis=(1, 2)).mean(), rel=1e-5)
    truth, occupied = crops > 0.5, guess > 0.5
    assert 0.1 < occupied.mean() < 0.9
    expected = (truth & occupied).sum() / (truth | occupied).sum()
    assert found["validation_iou"] == pytest.approx(expected, abs=1e-3)


def test_gradients_are_clipped_by_one_norm():
    """All are 0.5 or, in the biases, -2: scaled by 2.5 / norm if that is less than 1."""
    for limit in (2.5, 1e5):
        one, norm = learner(clip_norm=limit), 0.0
        for weights in one.network.parameters():
            weights.grad = torch.full_like(weights, -2.0 if weights.dim() == 1 else 0.5)
            norm += float(weights.grad.square().sum())
        one.clip()
        scale = min(1.0, limit / np.sqrt(norm))
        np.testing.assert_allclose(one.network.bias1.grad, [-2.0 * scale], rtol=1e-5)
        np.testing.assert_allclose(one.network.encoder.fc.weight.grad, 0.5 * scale, rtol=1e-5)


def test_first_step_of_adam_is_the_learning_rate():
    """Kingma & Ba 2015: m / sqrt(v) is the sign of the gradient in the first step."""
    one = learner()
    before = [weights.detach().clone() for weights in one.network.parameters()]
    one.loss(np.arange(5), 0).total.backward()
    one.optimizer.step()
    for old, new in zip(before, one.network.parameters(), strict=True):
        large = new.grad.abs() > 1e-3
        np.testing.assert_allclose((old - new)[large].detach(), 0.013 * new.grad[large].sign(), rtol=1e-3)


def test_weights_of_pre_training_follow_the_seed_and_ties():
    torch.manual_seed(11)
    expected = GridAutoencoder(16, 3)
    assert all(
        torch.equal(a, b) for a, b in zip(expected.parameters(), learner().network.parameters(), strict=True)
    )
    assert learner().memory == {}
    assert not len(learner().network.decoder)
    assert len(learner(tied=False).network.decoder) == 4
