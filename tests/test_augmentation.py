"""Augmentation of the training tracks: each changes what it names and nothing else."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.datasets import LaneBatch
from pedpred.training.augmentation import Augmentation, augment, look_up
from tests.exported import rows_of

CPU = torch.device("cpu")
ROWS, LANES, LENGTH, HORIZON = 40, 8, 5, 3


def some_data(rng):
    shapes = ((2,), (6,), (HORIZON, 2), (7,))
    parts = (torch.from_numpy(rng.random((ROWS, *shape), np.float32)) for shape in shapes)
    velocity, angular, future, embedding = parts
    codes = {"grid": embedding.to(torch.float16), "empty": {"grid": torch.arange(7).float() + 2.0}}
    return rows_of(velocity, future, tracks=1, angular=angular + 0.1, **codes)


def some_batch(rng):
    rows = rng.permutation(ROWS).reshape(LANES, LENGTH)
    return LaneBatch(rows, np.zeros(LANES, bool), rng.random((LANES, 3), np.float32))


def both(how, seed=0):
    """Inputs and targets as they are and as they are augmented, the batch, and what was drawn."""
    data, batch = some_data(np.random.default_rng(1)), some_batch(np.random.default_rng(2))
    drawn = augment(batch, how, np.random.default_rng(seed))
    rows = torch.from_numpy(batch.rows)
    return (data.inputs(rows), data.future[rows]), look_up(data, drawn), batch, drawn


def test_nothing_varies_by_default():
    (plain, future), (same, target), _, _ = both(Augmentation())
    assert torch.equal(target, future)
    assert all(torch.equal(same[name], plain[name]) for name in plain)


def test_strange_lanes_are_mirrored_beside_the_obstacles_of_their_neighbour():
    (plain, future), (other, target), batch, _ = both(Augmentation(map_swap=0.5))
    strange = batch.chance[:, 0] < 0.5
    assert 0 < strange.sum() < len(strange)
    for lane, mirrored in enumerate(strange):
        sign = torch.tensor([1.0, -1.0 if mirrored else 1.0])
        seen = plain["angular"][lane].flip(-1) if mirrored else plain["angular"][lane]
        torch.testing.assert_close(other["state"][lane], plain["state"][lane] * sign)
        torch.testing.assert_close(target[lane], future[lane] * sign)
        torch.testing.assert_close(other["angular"][lane], seen)
        torch.testing.assert_close(other["grid"][lane], plain["grid"][lane - int(mirrored)])


def test_a_pace_scales_what_was_and_what_will_be():
    (plain, future), (other, target), batch, _ = both(Augmentation(speed_scale=(0.5, 1.5)))
    factor = torch.from_numpy(0.5 + batch.chance[:, 1])
    torch.testing.assert_close(other["state"], plain["state"] * factor[:, None, None])
    torch.testing.assert_close(target, future * factor[:, None, None, None])
    assert torch.equal(other["grid"], plain["grid"])


def test_who_stands_hardly_moves_and_will_hardly_move():
    (plain, future), (other, target), batch, _ = both(Augmentation(standing_share=0.5))
    standing = torch.from_numpy(batch.chance[:, 2] < 0.5)
    assert 0 < standing.sum() < len(standing)
    assert torch.equal(other["state"][~standing], plain["state"][~standing])
    assert (other["state"][standing].abs() <= 0.1 * plain["state"][standing].abs()).all()
    assert (target[standing].abs() <= 0.1 * future[standing].abs()).all()
    assert torch.equal(target[~standing], future[~standing])


def test_noise_is_on_the_velocity_seen_and_not_on_what_will_be():
    (plain, future), (other, target), _, _ = both(Augmentation(velocity_noise_mps=0.2))
    noise = other["state"] - plain["state"]
    assert 0.1 < noise.std() < 0.3  # 80 numbers
    assert torch.equal(target, future)
    assert all(torch.equal(other[name], plain[name]) for name in ("angular", "grid"))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_unseen_people_and_unmapped_ground_are_empty_and_the_rest_is_untouched(seed, share):
    how = Augmentation(neighbour_dropout=share, map_dropout=share)
    (plain, future), (other, target), _, drawn = both(how, seed)
    unseen, unmapped = drawn.crowd < 0, drawn.scenery < 0
    assert not other["angular"][unseen].any()
    assert torch.equal(other["angular"][~unseen], plain["angular"][~unseen])
    assert (other["grid"][unmapped] == torch.arange(7) + 2.0).all()  # an empty crop's code, which is not 0
    assert torch.equal(other["grid"][~unmapped], plain["grid"][~unmapped])
    assert torch.equal(other["state"], plain["state"])
    assert torch.equal(target, future)
    assert (unmapped == unmapped[:, :1]).all()  # all along a sub-sequence
    if share in (0.0, 1.0):
        assert (unseen == bool(share)).all()
        assert (unmapped == bool(share)).all()


def test_about_the_share_asked_for_is_hidden():
    batch = LaneBatch(np.zeros((400, 10), int), np.zeros(400, bool), np.ones((400, 3), np.float32))
    drawn = augment(batch, Augmentation(neighbour_dropout=0.25, map_dropout=0.5), np.random.default_rng(0))
    assert (drawn.crowd < 0).float().mean() == pytest.approx(0.25, abs=0.03)
    assert (drawn.scenery < 0).float().mean() == pytest.approx(0.5, abs=0.1)


def test_lanes_shared_among_processes_vary_as_they_would_together():
    """A strange lane sees its neighbour's obstacles also where the neighbour is another process's."""
    how = Augmentation(0.5, (0.5, 1.5), 0.2, 0.3, 0.3)
    _, (whole, target), _, drawn = both(how)
    data = some_data(np.random.default_rng(1))
    halves = [look_up(data, drawn.part(lanes, CPU)) for lanes in (slice(0, 4), slice(4, 8))]
    for name, values in whole.items():
        assert torch.equal(torch.cat([inputs[name] for inputs, _ in halves]), values)
    assert torch.equal(torch.cat([future for _, future in halves]), target)
