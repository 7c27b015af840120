"""Networks without memory learn from situations: drawn by shares, resumed exactly."""

import dataclasses
from itertools import islice

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.datasets.rows import load_rows
from pedpred.datasets.splits import select_held_out
from pedpred.errors import ValueRuleError
from pedpred.features import ForecastProtocol
from pedpred.models.features import RowFormat
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.models.registry import parse_settings
from pedpred.rows.files import write_manifest, write_shard
from pedpred.training.distributed import DistributedContext
from pedpred.training.instants import InstantSettings
from pedpred.training.loop import train
from tests.exported import widths_of

STEPS = 4
SIZES = MixtureFeatures(history_steps=3, neighbours=4, beams=16)
MADE_WITH = RowFormat(ForecastProtocol(horizon_steps=STEPS), "mixture", SIZES)
NETWORK = parse_settings({"architecture": "mixture", "modes": 2, "units": 16})
QUICK = InstantSettings(
    **{"steps": 6, "validate_every": 3, "lr": 1e-2, "warmup_steps": 2, "seed": 3, "rows": 32},
    **{"shares": {"a": 0.75, "b": 0.25}, "validation_share": 0.25, "clip_norm": 1.0, "weight_decay": 1e-4},
)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Set `a` of eight worlds of ten rows, and `b` of four: people who stop where a wall is near."""
    root, rng = tmp_path_factory.mktemp("situations"), np.random.default_rng(0)
    for name, worlds in {"a": 8, "b": 4}.items():
        for world in range(worlds):
            columns = {k: rng.normal(size=(10, n)).astype(np.float32) for k, n in widths_of(SIZES).items()}
            near = rng.random(10) < 0.5
            columns["beams"] = np.where(near[:, None], 1.0, 10.0) * np.ones((10, SIZES.beams))
            columns["neighbours"][:] = 0.0
            columns["future"] = (
                columns["state"][:, None] * np.where(near, 0.0, 1.0)[:, None, None] * np.ones((4, 1))
            )
            write_shard([columns], root / name, f"w{world}", MADE_WITH)
        write_manifest(root / name, MADE_WITH, {f"w{world}": str(world) for world in range(worlds)})
    return {name: root / name for name in "ab"}


def learner(folders, how=QUICK, **context):
    torch.manual_seed(0)
    network = NETWORK.build(widths_of(SIZES), STEPS)
    here = DistributedContext(torch.device("cpu"), **context)
    return how.learner(network, load_rows(folders), here)


def test_rows_are_those_on_disk_and_sets_must_have_the_same_sizes(folders, tmp_path):
    data = load_rows(folders)
    assert len(data.future) == 120
    assert data.by_set["b"].tolist()[0] == [80, 90]
    assert {name: v.shape[1] for name, v in data.channels.items()} == widths_of(SIZES)
    fewer = dataclasses.replace(MADE_WITH, features=dataclasses.replace(SIZES, beams=8))
    write_manifest(tmp_path, fewer, {})
    with pytest.raises(ValueRuleError, match=r"other, beams.*a has 16"):
        load_rows({"a": folders["a"], "other": tmp_path})


def test_a_training_goes_on_where_it_was_interrupted(folders, tmp_path):
    one = learner(folders)
    curve = train(one, None, "whole")
    two = learner(folders)
    batches = two.batches
    two.batches = lambda done: islice(batches(done), 4 - done) if done < 4 else batches(done)
    with pytest.raises(StopIteration):
        train(two, tmp_path, "interrupted")
    again = learner(folders)
    assert train(again, tmp_path, "resumed")[1:] == curve[1:]
    for name, weights in one.network.state_dict().items():
        torch.testing.assert_close(again.network.state_dict()[name], weights, rtol=0, atol=0)


def test_an_encoder_may_stay_as_it_was_drawn(folders):
    settings = dataclasses.replace(NETWORK, frozen=["beams"])
    data = load_rows(folders)
    taught = QUICK.learner(settings.build(widths_of(SIZES), STEPS), data)
    before = {name: weights.clone() for name, weights in taught.network.state_dict().items()}
    train(taught, None, "train")
    changed = {n for n, weights in taught.network.state_dict().items() if not torch.equal(weights, before[n])}
    assert changed == {name for name in before if not name.startswith("beams.")}


def test_it_learns_what_obstacles_mean(folders):
    taught = learner(folders, dataclasses.replace(QUICK, steps=150, validate_every=150))
    before, after = train(taught, None, "learn")
    assert after["validation_ade_m"] < 0.7 * before["validation_ade_m"]


@settings(max_examples=25, deadline=None)
@given(worlds=st.integers(0, 40), share=st.floats(0, 0.99), seed=st.integers(0, 99))
def test_some_world_is_left_to_train_on(worlds, share, seed):
    kept = select_held_out(np.zeros((worlds, 2), int), share, np.random.default_rng(seed))
    assert len(kept) == worlds
    assert worlds == 0 or kept.sum() == min(round(share * worlds), worlds - 1)


def test_shares_of_nothing_are_refused():
    with pytest.raises(ValueRuleError):
        dataclasses.replace(QUICK, shares={"a": 0.0})
