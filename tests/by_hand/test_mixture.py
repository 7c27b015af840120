"""Encoders, network and loss of the mixture model: values written down by hand."""

import numpy as np
import pytest
import torch

from pedpred.models.mixture.encoders import BeamEncoder, NeighbourEncoder, motion_known, own_motion, own_signs
from pedpred.models.mixture.mirror import mirrored_beams
from pedpred.models.mixture.network import MixtureSettings

HISTORY = [0.0, 0.0, 1.0, -0.1, 0.05, 1.0, -0.25, 0.2, 1.0, -0.3, 0.6, 1.0, 0.3, 0.1, 0.0]
"""(forward, left), m, and whether it is known: five positions, of which the last one is unknown."""
STEPS = 3
WIDTHS = {"state": 2, "history": 15, "track": 6, "neighbours": 15, "beams": 12}


def doubles(values):
    return torch.tensor(values, dtype=torch.float64)


def check_close(found, expected):
    assert found.shape == expected.shape
    np.testing.assert_allclose(found.detach(), expected.detach(), rtol=2e-6, atol=1e-7)


def drawn(module, std=0.4):
    """The module with unequal weights in double precision."""
    generator = torch.Generator().manual_seed(3)
    for weights in module.parameters():
        torch.nn.init.normal_(weights, std=std, generator=generator)
    return module.double()


def linear(layer, values, weight="weight"):
    """W x + b of a layer, in numpy."""
    return getattr(layer, weight).detach().numpy() @ values + layer.bias.detach().numpy()


def relu(values):
    return np.maximum(values, 0.0)


def test_own_motion_is_scaled_by_hand():
    """Last velocity / 2; 5, 3 and 1 times the roots of P_pp, P_pv, P_vv, which may be below 0.

    Seen: 10 age and 10 age - 1 in [0, 1]: (1, 0.5) at age 0.15 and (0.5, 0) at 0.05. Speed 0.5 m/s.
    Jitter 1 - exp(-5 |x_2 - 2 x_1 + x_0|) with (-0.05, 0.1) and (0.1, 0.25) m; 0 at the unknown position.
    """
    inputs = {
        "state": doubles([[0.3, -0.4]] * 2),
        "history": doubles([HISTORY] * 2),
        "track": doubles([[0.6, -0.2, 0.04, 0.09, -0.01, 0.15], [0.6, -0.2, -0.04, -0.09, 0.25, 0.05]]),
    }
    jitter = [1 - np.exp(-5 * np.hypot(0.05, 0.1)), 1 - np.exp(-5 * np.hypot(0.1, 0.25)), 0.0]
    expected = [
        [0.3, -0.4, *HISTORY, 0.3, -0.1, 1.0, 0.9, 0.0, 0.15, 1.0, 0.5, 0.5, *jitter],
        [0.3, -0.4, *HISTORY, 0.3, -0.1, 0.0, 0.0, 0.5, 0.05, 0.5, 0.0, 0.5, *jitter],
    ]
    check_close(own_motion(inputs), doubles(expected))


def test_signs_of_own_motion_in_the_mirror():
    """Left velocities and positions: 2nd number, 2nd of each past position, and of the last velocity."""
    assert own_signs(9) == [1, -1, 1, -1, 1, 1, -1, 1, 1, -1, 1, 1, -1, 1, 1, 1, 1, 1, 1, 1, 1]


def test_motion_is_known_by_its_largest_number():
    """s / (s + 0.001), s the largest of |velocities| and |positions|; the last velocity comes halved.

    One number of -0.003 at a time, of two past positions: 0.75, or 6 / 7 for the last velocity.
    """
    found = motion_known(-0.003 * torch.eye(17, dtype=torch.float64))
    three, six = 3 / 4, 6 / 7
    expected = [three, three, three, three, 0, three, three, 0, six, six, *[0] * 7]
    check_close(found[:, 0], doubles(expected))
    both = motion_known(doubles([[0.009, *[0.0] * 7, -0.0095, *[0.0] * 8]]))
    assert both.item() == pytest.approx(0.95)
    assert motion_known(torch.zeros(1, 17)).item() == 0.0


# x, y, vx, vy and weight of neighbours who come closest in 7.2 / 2.3 s, now, and in 0.0104 / 0.050416 s
PEOPLE = [[3.0, 4.0, -1.0, -1.2, 1.0], [-1.0, 2.0, -0.5, 1.5, 0.5], [0.5, 0.1, 0.18, -0.304, 0.75]]
STATE = [0.2, -0.3]


def facts_by_hand(x, y, vx, vy, sx, sy):
    """(x, y) / 4, relative velocity, velocity, e^-|x|, 1 / (1 + |x|), 0.3 t, e^-|x + t r|.

    The time of the closest approach is t = -x r / (r^2 + 0.05) in [0, 4] s, r the relative velocity.
    """
    place, r = np.array([x, y]), np.array([vx - sx, vy - sy])
    t = np.clip(-(place @ r) / (r @ r + 0.05), 0.0, 4.0)
    away, passing = np.hypot(*place), np.hypot(*(place + t * r))
    return np.array([x / 4, y / 4, *r, vx, vy, np.exp(-away), 1 / (1 + away), 0.3 * t, np.exp(-passing)])


def neighbours_by_hand(encoder, people, state, motion):
    """The largest and a quarter of the sum of w relu(W2 h + b2), h = relu(W1 facts + b1 + Wo motion + bo)."""
    hidden = [
        relu(linear(encoder.first, facts_by_hand(*one[:4], *state)) + linear(encoder.observer, motion))
        for one in people
    ]
    each = [one[4] * relu(linear(encoder.second, own)) for one, own in zip(people, hidden, strict=True)]
    return np.concatenate([np.max(each, axis=0), 0.25 * np.sum(each, axis=0)])


@pytest.mark.parametrize("sides", [1, 2])
def test_neighbours_are_encoded_one_by_one(sides):
    encoder = drawn(NeighbourEncoder(3, 15, 4, sides))
    assert encoder.units == 8
    late = [2.0, 0.5, -0.25, 0.05, 0.25]  # comes closest in 4.6 s, above the limit of 4 s
    crowd = np.array([PEOPLE, [late, *np.zeros((2, 5))]])
    states, motion = np.array([STATE, [0.0, 0.1]]), np.random.default_rng(1).normal(size=(2, sides, 3))
    tensors = [torch.tensor(values) for values in (crowd.reshape(2, 15), states, motion.reshape(-1, 3))]
    found = encoder(*tensors).detach().reshape(2, sides, 8)
    for row in range(2):
        for side in range(sides):
            flip = (-1.0) ** side  # of what lies left
            seen = crowd[row] * [1.0, flip, 1.0, flip, 1.0]
            expected = neighbours_by_hand(encoder, seen, states[row] * [1.0, flip], motion[row, side])
            np.testing.assert_allclose(found[row, side], expected, rtol=1e-9, atol=1e-12)


def beams_by_hand(encoder, beams):
    """relu(J p + c), p = relu(W q + b) of each four beams; q: (1 - d / 10, e^-d) of these and before."""
    fours = beams.reshape(-1, 4)
    read = [np.concatenate([1 - 0.1 * four, np.exp(-four)]) for four in fours]
    patches = [relu(linear(encoder.patch, np.concatenate([read[k - 1], read[k]]))) for k in range(len(fours))]
    return relu(linear(encoder.join, np.concatenate(patches)))


@pytest.mark.parametrize("sides", [1, 2])
def test_beams_are_encoded_by_patches_of_eight(sides):
    encoder, beams = drawn(BeamEncoder(12, 5, sides)), np.random.default_rng(2).uniform(0, 9, (2, 12))
    found = encoder(torch.tensor(beams)).detach().reshape(2, sides, 5)
    for row, own in enumerate(beams):
        mirrored = np.roll(own[::-1], 1)
        for side, seen in enumerate([own, mirrored][:sides]):
            np.testing.assert_allclose(found[row, side], beams_by_hand(encoder, seen), rtol=1e-9, atol=1e-12)


def network_of(std=0.4, **settings):
    """A small network with unequal weights, in double precision but for its outputs."""
    sizes = {"units": 6, "motion_units": 5, "neighbour_units": 4, "obstacle_units": 3}
    return drawn(MixtureSettings(**sizes | settings).build(WIDTHS, STEPS), std).eval()


def people():
    """One who walks, one who hardly does (0.5 mm/s, 0.25 mm off: known by 1/3) and one who stands."""
    rng = np.random.default_rng(5)
    history = np.zeros((3, 5, 3))
    history[0], history[:, :4, 2], history[1, 1, 0] = np.reshape(HISTORY, (5, 3)), 1.0, -0.00025
    track = rng.uniform(0.05, 0.3, (3, 6)) * (np.arange(6) >= 2)
    track[0, :2] = 0.4, -0.2
    inputs = {"state": [[0.3, -0.4], [0.0, 0.0005], [0.0, 0.0]], "history": history, "track": track}
    inputs |= {"neighbours": [np.array(PEOPLE) * [1, 1, 1, 1, w] for w in (1.0, 0.7, 0.4)]}
    inputs["beams"] = rng.uniform(0.2, 9.0, (3, 12))
    return {name: torch.tensor(np.reshape(values, (3, -1))) for name, values in inputs.items()}


def outputs_by_hand(network, inputs, row, known):
    """Outputs of the heads, a list per side; the surroundings count as far as the motion is known."""
    own, state = own_motion(inputs)[row].numpy(), inputs["state"][row].numpy()
    near, beams = inputs["neighbours"][row].numpy().reshape(3, 5), inputs["beams"][row].numpy()
    found = {name: [] for name in network.heads}
    for flip in [1.0, -1.0][: network.sides]:
        seen = own * np.where(np.array(own_signs(WIDTHS["history"])) < 0, flip, 1.0)
        motion = relu(linear(network.own[2], relu(linear(network.own[0], seen))))
        turn = [1.0, flip, 1.0, flip, 1.0]
        around = neighbours_by_hand(network.neighbours, near * turn, state * turn[:2], motion)
        walls = beams_by_hand(network.beams, beams if flip > 0 else np.roll(beams[::-1], 1))
        fused = relu(linear(network.layers[0], np.concatenate([motion, known * around, known * walls])))
        for layer in network.layers[1:]:
            fused = fused + relu(linear(layer, fused))
        for name, head in network.heads.items():
            found[name].append(linear(head, fused))
    return found


def check_outputs(network, inputs, given):
    """Point: state + known * mean of the sides. Modes: state + known * each side's, turned back.

    Log weights: softmax over all modes. Raw a and c: their mean +- known * half their difference.
    """
    outputs, after = network.step(given, {})
    assert after == {}
    for row, known in enumerate(motion_known(own_motion(inputs))[:, 0].tolist()):
        heads = outputs_by_hand(network, inputs, row, known)
        now, flips = inputs["state"][row].numpy(), [1.0, -1.0][: network.sides]
        both = zip(heads["velocities"], flips, strict=True)
        point = np.mean([own.reshape(STEPS, 2) * [1.0, flip] for own, flip in both], axis=0)
        both = zip(heads["modes"], flips, strict=True)
        modes = np.concatenate([own.reshape(-1, STEPS, 2) * [1.0, flip] for own, flip in both])
        weight = np.exp(np.concatenate(heads["weight"]))
        both = zip(heads["spread"], flips, strict=True)
        spread = [own.reshape(-1, STEPS, 3) * [1.0, 1.0, flip] for own, flip in both]
        a, c, k = np.concatenate(spread).transpose(2, 0, 1)
        spread = np.stack([(a + c + known * (a - c)) / 2, (a + c - known * (a - c)) / 2, known * k], axis=-1)
        expected = {"velocities": now + known * point, "modes": now + known * modes, "spread": spread}
        expected |= {"weight": np.log(weight / weight.sum()), "prior": np.tile(now, (STEPS, 1))}
        assert outputs.keys() == expected.keys()
        for name, values in expected.items():
            np.testing.assert_allclose(outputs[name][row].detach(), values, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(("mirrored", "modes"), [(True, 4), (False, 3)])
def test_network_by_hand(mirrored, modes):
    inputs = people()
    known = motion_known(own_motion(inputs))[:, 0]
    check_close(known, doubles([0.6 / 0.601, 1 / 3, 0.0]))
    check_outputs(network_of(mirrored=mirrored, modes=modes), inputs, inputs)


@pytest.mark.parametrize("unread", ["history", "neighbours", "beams", "neighbour_velocities"])
def test_unread_inputs_count_as_zeros(unread):
    given, inputs = people(), people()
    if unread == "neighbour_velocities":
        inputs["neighbours"] = (inputs["neighbours"].reshape(3, 3, 5) * doubles([1, 1, 0, 0, 1])).flatten(1)
    else:
        inputs[unread] = 0.0 * inputs[unread]
    check_outputs(network_of(modes=4, unread=(unread,)), inputs, given)


def test_sub_sequences_are_forecast_row_by_row():
    network, inputs = network_of(modes=4), people()
    assert (network.state_shapes, network.start(3)) == ({}, {})
    rows, _ = network.step(inputs, {})
    outputs, after = network({name: values[None].repeat(2, 1, 1) for name, values in inputs.items()}, {})
    assert after == {}
    for name, values in outputs.items():
        check_close(values, rows[name][None].expand_as(values))


def test_mirrored_inputs_have_mirrored_forecasts():
    """Modes of both halves change places; left and k change their sign."""
    network, inputs = network_of(modes=4), people()
    turn = {"state": [1, -1], "history": [1, -1, 1] * 5, "track": [1, -1, 1, 1, 1, 1]}
    turn["neighbours"] = [1, -1, 1, -1, 1] * 3
    other = {name: inputs[name] * doubles(signs) for name, signs in turn.items()}
    other["beams"] = mirrored_beams(inputs["beams"])
    one, two = (network.step(seen, {})[0] for seen in (inputs, other))
    left = doubles([1.0, -1.0])
    check_close(two["velocities"], one["velocities"] * left)
    check_close(two["modes"], one["modes"].roll(2, 1) * left)
    check_close(two["weight"], one["weight"].roll(2, 1))
    check_close(two["spread"], one["spread"].roll(2, 1) * doubles([1.0, 1.0, -1.0]))


def test_an_untrained_network_has_small_heads():
    """Its point forecast has no weights yet, other heads 0.3 of the usual ones, at most 1 / sqrt(units).

    Deviations begin with 0.05, 0.1 and 0.15 m along the horizon, above their floor.
    """
    network = MixtureSettings(modes=8, units=64).build(WIDTHS, STEPS)
    heads = dict(network.heads.named_parameters())
    assert not any(heads[f"velocities.{kind}"].any() for kind in ("weight", "bias"))
    for name in ("modes.weight", "modes.bias", "weight.weight", "spread.weight"):
        assert 0.6 * 0.3 / 8 < heads[name].abs().max() <= 0.3 / 8
    bias = heads["spread.bias"].detach().reshape(4, STEPS, 3)
    deviation = np.log1p(np.exp(bias[..., :2].numpy()))
    np.testing.assert_allclose(deviation, np.broadcast_to([[0.05], [0.1], [0.15]], (4, 3, 2)), rtol=1e-5)
    assert not bias[..., 2].any()


@pytest.mark.parametrize("frozen", [(), ("own",), ("neighbours", "beams")])
def test_frozen_encoders_are_not_trained(frozen):
    network = MixtureSettings(modes=2, units=4, frozen=frozen).build(WIDTHS, STEPS)
    for name, weight in network.named_parameters():
        assert weight.requires_grad == (name.split(".")[0] not in frozen)
