"""A narrow encoder learns the codes of a full one."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from pedpred.datasets.crops import EmbeddedCrops, EmbeddedSplit, embedded_crops_of
from pedpred.errors import ShapeError, ValueRuleError
from pedpred.features import FeatureSettings, extract_blocks
from pedpred.networks import GridEncoder
from pedpred.networks.encoding import encode, load_encoder
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.storage.scenes import write_scene
from pedpred.storage.shards import write_embeddings, write_manifest, write_shard
from pedpred.training.distillation import DistillationLearner, DistillationSettings, crops_at, unexplained
from pedpred.training.loop import train
from tests.exported import same_weights
from tests.worlds import squares, tracked, walled_scene

QUICK = {"batch": 8, "steps": 40, "validate_every": 20, "lr": 1e-2, "warmup_steps": 5, "seed": 0}
SHORT = DistillationSettings(widths=(8, 8), **QUICK)


@pytest.fixture(scope="module")
def taught():
    """A teacher and what it makes of crops with one square each."""
    torch.manual_seed(0)
    teacher, packed = GridEncoder(60, 16), squares(np.random.default_rng(0), 40)
    return teacher, EmbeddedCrops(packed, encode(teacher, packed, 60).astype(np.float16), 60)


def test_a_narrow_encoder_learns_and_repeats(taught):
    teacher, crops = taught
    learner, again = (DistillationLearner(teacher, crops, crops, SHORT) for _ in range(2))
    student, curve = learner.network, train(learner, None, "toy")
    for share in ("validation_embedding_missed", "validation_latent_missed"):
        assert curve[-1][share] < 0.3 * curve[0][share]
    assert student.conv1.out_channels == 8
    assert torch.equal(student.fc.weight, teacher.fc.weight)
    train(again, None, "toy")
    assert same_weights(student, again.network)


def test_the_teacher_misses_nothing_and_a_constant_everything(taught):
    teacher, crops = taught
    images = torch.from_numpy(np.unpackbits(crops.packed, axis=-1, bitorder="little")).reshape(-1, 60, 60)
    exact = teacher.embedding(images.float()).detach()
    assert unexplained(teacher, images.float(), exact)["embedding"] < 1e-10
    mean = GridEncoder(60, 16)
    mean.fc.load_state_dict(teacher.fc.state_dict())
    mean.embedding = lambda images: exact.mean(dim=0).expand(len(images), -1)
    missed = unexplained(mean, images.float(), exact)
    np.testing.assert_allclose([missed[key].item() for key in ("embedding", "latent")], 1.0, rtol=1e-5)


def test_validation_in_blocks_is_that_of_all_crops_at_once(taught, monkeypatch):
    teacher, crops = taught
    learner = DistillationLearner(teacher, crops, crops, replace(SHORT, widths=(4, 6)))
    whole = learner.validate()
    monkeypatch.setattr("pedpred.training.distillation._CROPS_AT_ONCE", 7)  # of 40: the last block is short
    blocks = learner.validate()
    direct = unexplained(learner.network, *crops_at(crops, np.arange(len(crops))))
    for name, share in direct.items():
        assert whole[f"validation_{name}_missed"] == pytest.approx(share.item(), rel=1e-5)
        assert blocks[f"validation_{name}_missed"] == pytest.approx(share.item(), rel=1e-5)


def test_a_narrow_encoder_comes_back_from_disk(taught, tmp_path):
    narrow, (_, crops) = GridEncoder(60, 16, (4, 6)), taught
    about = {"settings": {"latent": 16, "widths": [4, 6]}, "cells": 60}
    write_checkpoint(tmp_path, {f"encoder.{k}": v for k, v in narrow.state_dict().items()}, about)
    again = encode(load_encoder(tmp_path), crops.packed, 60)
    np.testing.assert_array_equal(again, encode(narrow, crops.packed, 60))
    assert again.dtype == np.float32


def test_crops_and_codes_stay_together_and_rooms_apart(tmp_path):
    settings = FeatureSettings()
    for index, name in enumerate(("a", "b", "c")):
        scene = walled_scene(np.random.default_rng(index))
        blocks = list(extract_blocks(scene, tracked(scene), settings))
        write_shard(blocks, tmp_path / "features", name)
        bits = np.concatenate([block.occupancy for block in blocks])
        write_embeddings([_code_of(bits)], tmp_path / "embeddings", name)
        write_scene(scene, tmp_path / "scenes" / name)
    scenes = {name: tmp_path / "scenes" / name for name in ("a", "b", "c")}
    write_manifest(tmp_path / "features", settings, scenes)

    def divided(share):
        folders, rng = (tmp_path / "features", tmp_path / "embeddings"), np.random.default_rng(0)
        return embedded_crops_of(*folders, EmbeddedSplit(validation_share=share, every=2), rng)

    training, validation = divided(0.3)
    assert len(training) > len(validation) > 0
    for part in (training, validation):
        np.testing.assert_array_equal(part.embedding, _code_of(part.packed))
    with pytest.raises(ValueRuleError, match="validation_share"):
        divided(0.9)
    write_embeddings([_code_of(bits[1:])], tmp_path / "embeddings", "c")
    with pytest.raises(ShapeError, match="embedding up to c"):
        divided(0.3)


def _code_of(packed):
    """A code that tells its crop: how many bits are set."""
    return np.bitwise_count(packed).sum(axis=1, dtype=np.float16)[:, None]
