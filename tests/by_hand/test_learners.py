"""Learners by hand: gradients through time, decay, clipping, validation, shares of sets, and several runs."""

import math
from dataclasses import replace
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch import nn

from pedpred.datasets.lanes import LaneBatch
from pedpred.models.contract import ForecastNetwork, Loss
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.training import instants
from pedpred.training.augmentation import Augmentation, augment
from pedpred.training.distributed import ALONE, DistributedContext
from pedpred.training.instants import InstantSettings
from pedpred.training.loop import train_step
from pedpred.training.masking import InputMasking, mask
from pedpred.training.sequences import SequenceSettings
from pedpred.training.sets import RealShare
from tests.by_hand.rows import DT_S, FIT, SEQUENCES, STEPS, data_of
from tests.exported import MIXTURE_ROWS, train_on

LANES = {"lanes": 2, "sub_sequence": 3, "longest_track": 100, "validation_by": "track"}
HOW = SequenceSettings(**FIT, **LANES, validation_share=0.3)
INSTANTS = InstantSettings(**FIT, rows=12, shares={"a": 6.0, "b": 2.0}, validation_share=0.3)
KEEP, GAIN = 0.7, (0.9, -0.4)
FREE_M = 10.0


class Leaky(ForecastNetwork):
    """h = keep h + gain x, forecast for all steps; the loss is the mean of |h - y|^2 dt, and twice that."""

    def __init__(self, remembers=True):
        channels = ("state",)
        super().__init__(SimpleNamespace(channels_read=channels), {"state": 2}, STEPS)
        self.keep, self.gain = nn.Parameter(torch.tensor([KEEP])), nn.Parameter(torch.tensor(GAIN))
        self.remembers, self.asked = remembers, []

    @property
    def state_shapes(self):
        return {"h": (2,)} if self.remembers else {}

    def forward(self, inputs, state):
        self.asked.append((torch.initial_seed(), inputs))
        driven = self.gain * inputs["state"]
        if self.remembers:
            h, all_h = state["h"], []
            for now in driven.unbind(1):
                h = self.keep * h + now
                all_h.append(h)
            driven, state = torch.stack(all_h, 1), {"h": h}
        return {"velocities": driven[..., None, :].expand(*driven.shape[:-1], STEPS, 2)}, state

    def loss(self, outputs, future, known, dt_s):
        squares = ((outputs["velocities"] - future) ** 2).sum(-1)[known] * dt_s
        return Loss(2 * squares.mean(), squares.mean(), known.sum())

    @property
    def score_names(self):
        return "far_m", "square"

    def scores(self, outputs, future, dt_s):
        far = torch.linalg.vector_norm(outputs["velocities"] - future, dim=-1) * dt_s
        return {"far_m": far, "square": far**2}

    def decode(self, outputs, dt_s):
        return outputs

    def clipped_groups(self):
        return [[self.keep], [self.gain]] if self.remembers else super().clipped_groups()


def sequence_learner(context=ALONE, **changes):
    how = replace(HOW, **changes)
    return train_on(Leaky(), data_of(), SEQUENCES[:2], SEQUENCES[1:], how, context)


def instant_learner(context=ALONE, **changes):
    torch.manual_seed(0)
    sizes = MixtureFeatures(history_steps=2, neighbours=2, beams=4, beam_range_m=FREE_M)
    shapes = {"beams": (20, 4), "neighbours": (20, 10), "history": (20, 9)}
    channels = {name: torch.rand(shape) for name, shape in shapes.items()}
    made_with = replace(MIXTURE_ROWS, features=sizes)
    data = data_of(made_with, ("a", "b"), (0, 1, 0, 1), **channels)
    data = replace(data, future_steps=torch.full((20,), STEPS))
    return replace(INSTANTS, **changes).learner(Leaky(remembers=False), data, context)


def unrolled(inputs, future, known, h):
    """Loss, its gradient by keep and by gain, and the last h, of one lane: sums over the known targets.

    dh_t / dkeep = h_(t-1) + keep dh_(t-1) / dkeep and dh_t / dgain = x_t + keep dh_(t-1) / dgain, both 0
    before the first step of the chunk: truncated back-propagation through time.
    """
    by_keep, by_gain, total, slope_keep, slope_gain = np.zeros(2), np.zeros(2), 0.0, 0.0, np.zeros(2)
    for x, targets, count in zip(inputs, future, known, strict=True):
        by_keep, by_gain, h = h + KEEP * by_keep, x + KEEP * by_gain, KEEP * h + np.array(GAIN) * x
        for target in targets[:count]:
            total += ((h - target) ** 2).sum()
            slope_keep += (2 * (h - target) * by_keep).sum()
            slope_gain += 2 * (h - target) * by_gain
    return total, slope_keep, slope_gain, h


def batch_of(rows, starts):
    lanes = LaneBatch(np.array(rows), np.array(starts), np.zeros((len(rows), 3), np.float32))
    return augment(lanes, Augmentation(), np.random.default_rng(0))


def test_gradients_stop_at_a_chunk_and_the_state_does_not():
    """Lane 0 goes on in the second chunk, mirrored and slower; lane 1 starts another track there."""
    learner = sequence_learner()
    learner.loss(batch_of([[0, 1, 2], [6, 7, 8]], [True, True]), 0)
    second = batch_of([[3, 4, 5], [9, 10, -1]], [False, True])
    noise = torch.from_numpy(np.random.default_rng(1).normal(size=(2, 3, 2)).astype(np.float32))
    mirrored, pace = torch.tensor([True, False]), torch.tensor([0.5, 1.5])
    found = learner.loss(replace(second, mirrored=mirrored, pace=pace, noise_mps=noise), 1)
    found.total.backward()

    data = learner.data
    x, y = (values.double().numpy() for values in (data.channels["state"], data.future))
    *_, h = unrolled(x[:3], y[:3], [0] * 3, np.zeros(2))
    sides = np.array([0.5, -0.5])
    lanes = [
        unrolled(x[3:6] * sides + noise[0].numpy(), y[3:6] * sides, [3, 1, 0], h),
        unrolled(
            np.append(1.5 * x[9:11], [[0, 0]], 0) + noise[1].numpy(), 1.5 * y[9:12], [3, 3, 0], np.zeros(2)
        ),
    ]
    loss, keep, gain = (sum(lane[i] for lane in lanes) * DT_S / 10 for i in range(3))  # 10 known targets
    assert found.reported.item() == pytest.approx(loss, rel=1e-5)
    assert found.total.item() == pytest.approx(2 * loss, rel=1e-5)
    assert int(found.weight) == 10
    assert float(learner.network.keep.grad) == pytest.approx(2 * keep, rel=1e-5)
    assert learner.network.gain.grad.tolist() == pytest.approx(2 * gain, rel=1e-5)
    np.testing.assert_allclose(learner.memory["h"].detach(), [lane[3] for lane in lanes], rtol=1e-5)


@pytest.mark.parametrize(
    ("made", "betas"), [(sequence_learner, (0.9, 0.999)), (instant_learner, (0.9, 0.98))]
)
def test_weights_decay_by_rate_and_move_by_moments(made, betas):
    """w -= lr wd w + lr m / (sqrt(v) + 1e-8), m and v without bias (Loshchilov & Hutter 2019, alg. 2)."""
    learner = made()
    weights = np.array(GAIN)
    moments = np.zeros((2, 2))
    nothing = torch.zeros(()), torch.ones(())
    learner.loss = lambda gradient, _: Loss((learner.network.gain * gradient).sum(), *nothing)
    for step, (gradient, rate) in enumerate([((2.0, 0.0), 0.125), ((-1.0, 0.0), 0.25), ((4.0, 0.5), 0.25)]):
        train_step(learner, torch.tensor(gradient), step)
        for i, power in enumerate((1, 2)):
            moments[i] = betas[i] * moments[i] + (1 - betas[i]) * np.array(gradient) ** power
        m, v = (moments[i] / (1 - betas[i] ** (step + 1)) for i in range(2))
        weights = weights - rate * 0.125 * weights - rate * m / (np.sqrt(v) + 1e-8)
        assert learner.network.gain.tolist() == pytest.approx(weights, rel=1e-5)
    assert learner.network.keep.item() == np.float32(KEEP)  # without a gradient there is no decay


@pytest.mark.parametrize(
    ("made", "limit", "keep", "gain"),
    [
        (sequence_learner, 2.0, 1.5, (1.2, -1.6)),  # each group by its own norm, 1.5 and 5
        (sequence_learner, 5.5, 1.5, (3.0, -4.0)),
        (sequence_learner, 1.0, 1.0, (0.6, -0.8)),
        (instant_learner, 2.61008, 0.75, (1.5, -2.0)),  # all by one norm, sqrt(1.5^2 + 5^2) = 5.22015
        (instant_learner, 5.5, 1.5, (3.0, -4.0)),
    ],
)
def test_gradients_are_clipped_to_the_norm_and_no_further(made, limit, keep, gain):
    learner = made(clip_norm=limit)
    learner.network.keep.grad, learner.network.gain.grad = torch.tensor([1.5]), torch.tensor([3.0, -4.0])
    learner.clip()
    assert learner.network.keep.grad.tolist() == pytest.approx([keep], rel=1e-4)
    assert learner.network.gain.grad.tolist() == pytest.approx(gain, rel=1e-4)


def test_dropout_differs_between_steps_seeds_and_processes():
    batch = batch_of([[0, 1, 2]], [True])
    for rank, seed, step, expected in [(0, 11, 0, 11), (0, 11, 4, 15), (1, 20, 1, 1_000_024)]:
        learner = sequence_learner(DistributedContext(ALONE.device, rank=rank, size=2), seed=seed)
        learner.loss(batch, step)
        assert learner.network.asked[-1][0] == expected


def test_batches_of_a_step_depend_on_its_number_alone():
    how = Augmentation(0.5, (0.5, 2.0), 0.3, 0.4, 0.5, 0.5)
    whole = list(islice(sequence_learner(augmentation=how).batches(0), 6))
    late = next(sequence_learner(augmentation=how).batches(4))
    parts = [
        next(
            sequence_learner(DistributedContext(ALONE.device, rank=rank, size=2), augmentation=how).batches(4)
        )
        for rank in (0, 1)
    ]
    for name, values in vars(whole[4]).items():
        assert torch.equal(getattr(late, name), values)
        assert torch.equal(torch.cat([getattr(part, name) for part in parts]), values)
    rng = np.random.default_rng([11, 4])
    unseen = rng.random((2, 3)) < 0.5
    assert ((whole[4].crowd == -1) == (torch.from_numpy(unseen) | (whole[4].rows == -1))).all()
    assert {int(row) for batch in whole for row in batch.rows.flatten()} <= {-1, *range(9)}  # of training
    assert sequence_learner(DistributedContext(ALONE.device, rank=1, size=2)).memory["h"].shape == (1, 2)


@pytest.mark.parametrize("at_once", [2, 32])
def test_sequences_are_validated_by_a_mean_over_windows(monkeypatch, at_once):
    """Of rows 6 to 19, those count whose three targets are all known, in however many blocks."""
    monkeypatch.setattr("pedpred.training.sequences._STEPS_AT_ONCE", at_once)
    learner = sequence_learner()
    x, y = (values.double().numpy() for values in (learner.data.channels["state"], learner.data.future))
    far = {}
    for first, last in SEQUENCES[1:]:
        h = np.zeros(2)
        for row in range(first, last):
            h = KEEP * h + np.array(GAIN) * x[row]
            far[row] = np.linalg.norm(h - y[row], axis=-1) * DT_S
    counted = np.stack([far[row] for row in (6, 9, 10, 11, 13, 14, 15, 17, 18)])
    found = learner.validate()
    assert found == pytest.approx(
        {"validation_far_m": counted.mean(), "validation_square": (counted**2).mean()}, rel=1e-5
    )
    assert learner.best_by == "validation_far_m"
    learner.data.future_steps[:] = 2
    assert all(math.isnan(value) for value in learner.validate().values())


def test_processes_divide_the_validation(monkeypatch):
    """Sums and counts are added, so that the mean is that of one process: windows weigh the same."""
    whole, sums = sequence_learner().validate(), []

    def adding(values):
        sums.append(values.clone())
        values.copy_(sum(sums))

    monkeypatch.setattr(torch.distributed, "all_reduce", adding)
    for rank in (0, 1):
        found = sequence_learner(DistributedContext(ALONE.device, rank=rank, size=2)).validate()
    assert found == pytest.approx(whole)
    assert [float(values[-1]) for values in sums] == [9.0, 18.0]  # steps of windows, as they lie


def test_sequences_are_divided_by_the_seed():
    data = data_of()
    learners = [replace(HOW, seed=seed).learner(Leaky(), data, ALONE) for seed in range(6)]
    for seed, learner in enumerate(learners):
        held = np.random.default_rng(seed).permutation(4)[:1]  # 30 % of four tracks
        np.testing.assert_array_equal(learner.sampler.validation, SEQUENCES[held])
        np.testing.assert_array_equal(learner.sampler.training, np.delete(SEQUENCES, held, axis=0))


def test_the_loss_of_instants_counts_all_targets_of_masked_rows():
    how = InputMasking(0.5, 0.5, 0.5, 0.5, 0.5)
    learner = instant_learner(DistributedContext(ALONE.device, rank=1, size=2), masking=how)
    rows, data = np.array([3, 17, 3, 5, 8]), learner.data
    found = learner.loss(rows, 4)
    x, y = (values.double().numpy()[rows] for values in (data.channels["state"], data.future))
    errors = np.array(GAIN) * x[:, None] - y
    assert found.reported.item() == pytest.approx((errors**2).sum(-1).mean() * DT_S, rel=1e-5)
    assert int(found.weight) == 5 * STEPS
    assert (learner.sampler.lanes, learner.sampler.examples(rows, 4).starts.all()) == (6, True)
    _, seen = learner.network.asked[-1]
    rng = np.random.default_rng([11, 4, 1])  # seed, step and rank
    for name, values in mask(data.inputs(torch.from_numpy(rows)), how, {"beams": FREE_M}, rng).items():
        assert torch.equal(seen[name], values)
    assert (seen["beams"] == FREE_M).any()


@pytest.mark.parametrize("at_once", [4, 4096])
def test_instants_are_validated_by_a_mean_over_rows(monkeypatch, at_once):
    monkeypatch.setattr(instants, "_ROWS_AT_ONCE", at_once)
    learner = instant_learner(validation_share=0.5)
    rows, data = learner.sampler.validation, learner.data
    x, y = (values.double().numpy()[rows] for values in (data.channels["state"], data.future))
    far = np.linalg.norm(np.array(GAIN) * x[:, None] - y, axis=-1) * DT_S
    assert len(far) == 11  # a whole world of 7 and one of 4
    assert learner.validate() == pytest.approx(
        {"validation_far_m": far.mean(), "validation_square": (far**2).mean()}, rel=1e-5
    )
    nothing = instant_learner(validation_share=0.0)
    assert len(nothing.sampler.validation) == 0
    assert all(math.isnan(value) for value in nothing.validate().values())


def test_worlds_of_a_set_are_learned_or_kept_as_a_whole():
    """Set a has rows 0 to 5 and 9 to 15, set b 6 to 8 and 16 to 19; half of the worlds of each are kept."""
    learner = instant_learner(validation_share=0.5)
    rng = np.random.default_rng(11)
    training, kept = {}, []
    for name, worlds in {"a": [range(6), range(9, 16)], "b": [range(6, 9), range(16, 20)]}.items():
        held = rng.permutation(2)[0]
        training[name], kept = [*worlds[1 - held]], [*kept, *worlds[held]]
    assert {name: rows.tolist() for name, rows in learner.sampler.training.items()} == training
    assert learner.sampler.validation.tolist() == kept


def test_rows_of_a_step_are_drawn_by_shares():
    """Of 12 rows 9 are expected from a and 3 from b, however many rows they have; nothing from c."""
    learner = instant_learner(validation_share=0.0)
    counts = [np.isin(rows, learner.sampler.training["a"]).sum() for rows in islice(learner.batches(0), 400)]
    assert np.mean(counts) == pytest.approx(9.0, abs=0.3)
    assert np.var(counts) == pytest.approx(12 * 0.75 * 0.25, rel=0.3)  # binomial
    other = instant_learner(validation_share=0.0, shares={"b": 5.0, "c": 3.0})
    rows = np.concatenate(list(islice(other.batches(0), 20)))
    assert set(rows) == set(other.sampler.training["b"])
    whole = list(islice(learner.batches(2), 3))
    np.testing.assert_array_equal(next(learner.batches(4)), whole[2])
    assert not np.array_equal(whole[0], whole[1])
    first = [
        np.isin(rows[:6], learner.sampler.training["a"]).mean() for rows in islice(learner.batches(0), 200)
    ]
    assert np.mean(first) == pytest.approx(0.75, abs=0.05)  # each process's part is mixed


def test_shares_of_simulated_and_real_sets():
    shares = RealShare(real_share=0.4).mix({"s": 3.0, "t": 1.0}, {"x": 1, "y": 20, "z": 300})
    assert shares == pytest.approx({"s": 0.45, "t": 0.15, **dict.fromkeys("xyz", 0.4 / 3)})
    longer = RealShare(real_share=0.4, size_exponent=0.5).mix({"s": 1.0}, {"x": 1, "y": 4, "z": 25})
    assert longer == pytest.approx({"s": 0.6, "x": 0.05, "y": 0.1, "z": 0.25})  # as 1 : 2 : 5
    assert RealShare(real_share=0.4).mix({"s": 3.0, "t": 2.0}, {}) == pytest.approx({"s": 0.6, "t": 0.4})
    assert RealShare(real_share=1.0).mix({"s": 3.0}, {"x": 5}) == {"s": 0.0, "x": 1.0}
