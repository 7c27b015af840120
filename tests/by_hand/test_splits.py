"""Splits and lanes by hand: what stays together, what is kept for validation, and how tracks are streamed."""

from dataclasses import replace
from itertools import islice, pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from pedpred.datasets import crops as crops_module
from pedpred.datasets import rows as rows_module
from pedpred.datasets.crops import CropSplit, crops_of
from pedpred.datasets.lanes import cut, stream_lanes
from pedpred.datasets.rows import Spans, TrainingRows, load_rows, sequences_of
from pedpred.datasets.splits import SplitSettings, select_held_out, split_sequences
from pedpred.errors import ValueRuleError
from pedpred.features import ForecastProtocol
from pedpred.models.lstm.features import LstmFeatures
from tests.refused import refused

TRACKS = np.array([0, 0, 0, 1, 1, 2, 2, 2, 2, 3, 0, 0, 0, 1, 1, 2, 3, 3, 4, 4, 5, 5, 5, 5, 6, 6])
"""Of each sequence: tracks begin several times (other clocks), and come back as mirrored copies."""
SCENES = np.array([0] * 10 + [0] * 8 + [1] * 6 + [2] * 2)


def divide(by, share, seed):
    rows = np.stack([np.arange(26) ** 2, np.arange(1, 27) ** 2], axis=-1)
    data = SimpleNamespace(spans=Spans(rows, np.zeros(26, int), SCENES, TRACKS))
    how = SplitSettings(validation_by=by, validation_share=share)
    halves = split_sequences(data, how, np.random.default_rng(seed))
    return [np.sqrt(half[:, 0]).astype(int) for half in halves], halves, rows


@pytest.mark.parametrize(("by", "groups"), [("track", TRACKS), ("scene", SCENES)])
@pytest.mark.parametrize("seed", range(8))
def test_training_and_validation_share_no_track_and_no_scene(by, groups, seed):
    (training, validation), halves, rows = divide(by, 0.4, seed)
    assert set(groups[training]).isdisjoint(groups[validation])
    held = np.random.default_rng(seed).permutation(len(set(groups)))[: {"track": 3, "scene": 1}[by]]
    assert set(groups[validation]) == set(held)  # 40 % of 7 tracks, or of 3 scenes, whatever they hold
    assert sorted([*training, *validation]) == list(range(26))
    for chosen, half in zip((training, validation), halves, strict=True):
        np.testing.assert_array_equal(half, rows[np.sort(chosen)])  # as they lie on disk


def test_at_least_one_track_is_on_either_side():
    held = {share: len(set(TRACKS[divide("track", share, 0)[0][1]])) for share in (0.0, 0.2, 0.22, 0.92)}
    assert held == {0.0: 1, 0.2: 1, 0.22: 2, 0.92: 6}
    with refused("validation_by"):
        divide("track", 0.93, 0)  # 6.51 of 7


def test_worlds_are_kept_by_their_number():
    held = [
        select_held_out(np.zeros((5, 2)), share, np.random.default_rng(4)) for share in (0.0, 0.5, 0.7, 0.99)
    ]
    assert [int(chosen.sum()) for chosen in held] == [0, 2, 4, 4]
    assert set(np.flatnonzero(held[1])) == set(np.random.default_rng(4).permutation(5)[:2])


def table(track, step, known=0):
    """As much of the steps of tracks as is read."""
    columns = {"state": np.zeros((len(step), 2)), "future": np.zeros((len(step), 3, 2), np.float32)}
    columns |= {"track_id": np.array(track, int), "step": np.array(step)}
    return columns | {"future_steps": np.full(len(step), known, np.int8)}


FORMAT = SimpleNamespace(
    features=SimpleNamespace(channels=lambda stored: {"state": stored["state"]}),
    protocol=ForecastProtocol(dt_s=0.3, horizon_steps=3),
)


def test_sequences_start_at_step_zero_and_end_at_the_next(monkeypatch):
    assert sequences_of(np.array([])).shape == (0, 2)
    blocks = {
        "a": [table([0, 0, 0, 0, 4], [0, 1, 2, 0, 0]), table([7, 7], [0, 1])],
        "b": [table([2, 2, 7], [0, 1, 0], 2)],
        "c": [table([1], [0])],
        "none": [],
        "nobody": [table([], [])],
    }
    shards = {"x": {"a": "1", "b": "1", "c": "2"}, "y": {"none": "1"}, "w": {"nobody": "1"}}
    shards["z"] = {"c": "1", "b": "2"}
    codes = {
        name: [np.full((len(one["step"]), 1), i) for one in blocks[name]] for i, name in enumerate(blocks)
    }
    monkeypatch.setattr(rows_module, "read_manifest", lambda folder: (FORMAT, shards[folder]))
    monkeypatch.setattr(rows_module, "read_shard", lambda folder, shard, _: blocks[shard])
    monkeypatch.setattr(rows_module, "read_embeddings", lambda folder, shard: codes[shard])
    data = load_rows(dict(zip("yxwz", "yxwz", strict=True)), dict.fromkeys("yxwz"))
    edges = [0, 3, 4, 5, 7, 9, 10, 11, 12, 14, 15]
    assert data.spans.rows.tolist() == [list(span) for span in pairwise(edges)]
    # 8 ids in x, none in y and w; b is a variant of a in x, so that its tracks are the same people
    assert data.spans.track.tolist() == [0, 0, 4, 7, 2, 7, 1, 8 + 1, 8 + 2, 8 + 7]
    assert data.spans.scene.tolist() == [1, 1, 1, 1, 1, 1, 2, 4, 5, 5]  # one in y and in w, two in x
    assert data.spans.part.tolist() == [1] * 7 + [3] * 3
    assert data.by_set["z"].tolist() == [[11, 12], [12, 14], [14, 15]]
    assert data.future_steps.tolist() == [0] * 7 + [2] * 3 + [0, 0] + [2] * 3
    assert data.channels["grid"].flatten().tolist() == [0] * 7 + [1] * 3 + [2] * 2 + [1] * 3


def test_worlds_follow_each_other_whatever_their_set(monkeypatch):
    def read(folder, world, _):
        yield {"state": np.zeros((int(world), 2)), "future": np.zeros((int(world), 3, 2), np.float32)}

    monkeypatch.setattr(
        rows_module, "read_manifest", lambda folder: (FORMAT, {name: name for name in folder.split()})
    )
    monkeypatch.setattr(rows_module, "read_shard", read)
    data = load_rows({"a": "4 2", "b": "5"})
    assert data.spans.rows.tolist() == [[0, 4], [4, 6], [6, 11]]
    assert data.spans.part.tolist() == [0, 0, 1]
    assert data.spans.scene.tolist() == [0, 1, 2]
    assert data.spans.track.tolist() == [0, 0, 0]
    assert data.future_steps.tolist() == [3] * 11
    for other in (replace(FORMAT.protocol, dt_s=0.4), replace(FORMAT.protocol, horizon_steps=4)):
        formats = iter([FORMAT, SimpleNamespace(features=FORMAT.features, protocol=other)])
        monkeypatch.setattr(rows_module, "read_manifest", lambda _, those=formats: (next(those), {}))
        with pytest.raises(ValueRuleError, match=r"dt_s|horizon_steps"):
            load_rows({"a": "", "b": ""})


@pytest.mark.parametrize(("share", "held"), [(0.0, 1), (0.25, 1), (0.45, 2), (0.7, 3)])
def test_crops_of_a_scene_are_on_one_side(monkeypatch, share, held):
    """Five shards of four scenes, one of them a variant; each crop has the number of its scene."""
    shards = {"a": "0", "a_mirrored": "0", "b": "1", "c": "2", "d": "3"}
    made_with = SimpleNamespace(features=LstmFeatures(grid_cells=60))
    monkeypatch.setattr(crops_module, "read_manifest", lambda _: (made_with, shards))

    def read(folder, name, _):
        return [np.full((crops, 4), int(shards[name]), np.uint8) for crops in (2, 1)]

    monkeypatch.setattr(crops_module, "read_crops", read)
    order = np.random.default_rng(1).permutation(4)
    how = CropSplit(validation_share=share, validation_crops=99)
    training, validation, cells = crops_of(None, how, np.random.default_rng(1))
    assert cells == 60
    for crops, scenes in ((training, order[held:]), (validation, order[:held])):
        counts = {scene: 6 if scene == 0 else 3 for scene in scenes.tolist()}
        assert dict(zip(*np.unique(crops[:, 0], return_counts=True), strict=True)) == counts
    few = CropSplit(validation_share=share, validation_crops=2)
    assert crops_of(None, few, np.random.default_rng(1))[1].shape == (2, 4)


def test_targets_count_up_to_their_number_and_not_behind_a_track():
    data = SimpleNamespace(future=torch.zeros(3, 3, 2), future_steps=torch.tensor([2, 0, 3]))
    known = TrainingRows.known(data, torch.tensor([[0, 1], [2, -1]]))
    assert known.int().tolist() == [[[1, 1, 0], [0, 0, 0]], [[1, 1, 1], [0, 0, 0]]]


def test_long_tracks_are_cut_at_a_random_phase():
    """Tracks of 4, 14 and 5 steps in pieces of at most 4: [20, 34) at 20 + k, then every 4 steps."""
    phases = []
    for seed in range(60):
        pieces = cut(np.array([[3, 7], [20, 34], [50, 55]]), 4, np.random.default_rng(seed))
        begin = pieces[:, 0].tolist()
        k, late = begin[2] - 20, begin[-1]
        phases.append((k, late - 50))
        cuts = [20 + k, 24 + k, 28 + k, *([32 + k] if k == 1 else [])]
        assert begin == [3, 20, *cuts, 50, late]
        assert pieces[:, 1].tolist() == [7, *cuts, 34, late, 55]
    assert [set(phase) for phase in zip(*phases, strict=True)] == [{1, 2, 3, 4}] * 2


def test_lanes_walk_along_tracks_and_pad_behind_their_end():
    """One lane: two steps at a time, a track of 4 ends with a whole sub-sequence and one of 5 with a half."""
    batches = list(islice(stream_lanes(np.array([[10, 14]]), 1, 2, 9, np.random.default_rng(0)), 4))
    assert [batch.rows[0].tolist() for batch in batches] == [[10, 11], [12, 13]] * 2
    assert [bool(batch.starts[0]) for batch in batches] == [True, False] * 2
    batches = list(islice(stream_lanes(np.array([[10, 15]]), 2, 2, 9, np.random.default_rng(0)), 4))
    assert [batch.rows[1].tolist() for batch in batches] == [[10, 11], [12, 13], [14, -1], [10, 11]]
    assert [batch.starts.tolist() for batch in batches] == [[True] * 2, [False] * 2, [False] * 2, [True] * 2]
    chance = np.stack([batch.chance for batch in batches])
    np.testing.assert_array_equal(chance[1:3], chance[:2])  # an earlier batch is not overwritten
    assert len(np.unique(chance[[0, 3]])) == 12
    assert chance.dtype == np.float32


def test_a_pass_has_every_track_once_in_a_random_order():
    tracks = np.stack([np.arange(0, 60, 3), np.arange(3, 63, 3)], axis=-1)
    batches = islice(stream_lanes(tracks, 4, 3, 9, np.random.default_rng(0)), 10)
    passes = np.array([batch.rows[:, 0] for batch in batches]).reshape(2, 20)
    for one in passes:
        assert sorted(one) == list(range(0, 60, 3))
        assert 1 < np.abs(np.diff(one)).mean() / 3 < 15
        assert (np.diff(one) > 0).any()
        assert (np.diff(one) < 0).any()
    assert not np.array_equal(*passes)
