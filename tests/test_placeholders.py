"""Places in bags that stand for unknown ones are left out; where people really are, nothing is."""

import logging

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.ros import read_bag
from pedpred.ros.placeholders import find_placeholders
from tests.bags import bag

COUNT, STEP_S = 60, 0.25


def crowd(seed, people=4, around_m=20.0):
    """People who walk about somewhere, in order of time."""
    rng = np.random.default_rng(seed)
    steps = 0.3 * np.exp(1j * np.cumsum(rng.normal(0, 0.3, (COUNT, people)), axis=0))
    path = np.cumsum(steps, axis=0) + around_m * np.exp(2j * np.pi * rng.random(people))
    where = np.stack([path.real, path.imag], axis=-1).reshape(-1, 2)
    return np.repeat(STEP_S * np.arange(COUNT), people), np.tile(np.arange(people), COUNT), where


@given(st.integers(0, 10_000), st.integers(0, 8), st.sampled_from([(0.0, 0.0), (-1.0, -1.0), (999.0, 999.0)]))
def test_detections_at_a_placeholder_are_found_and_no_others(seed, gaps, where):
    time_s, track_id, position = crowd(seed)
    unknown, rng = np.zeros(len(time_s), bool), np.random.default_rng(seed)
    for _ in range(gaps):
        first = rng.integers(0, COUNT)
        of_one = np.flatnonzero(track_id == rng.integers(0, 4))
        unknown[of_one[first : first + rng.integers(1, 9)]] = True
    far = np.linalg.norm(position - where, axis=1).min() > 6.0 * STEP_S * COUNT  # also after long gaps
    near = np.linalg.norm(position - where, axis=1).min() < 3.0
    position[unknown] = where
    found = find_placeholders(time_s, track_id, position)
    assert not found[~unknown].any()
    if where == (0.0, 0.0) and not near and unknown.mean() < 0.3:
        np.testing.assert_array_equal(found, unknown)
    if far and gaps == 8:
        assert found.sum() in (0, unknown.sum())


def test_people_may_walk_through_the_origin_and_stand_there():
    time_s = STEP_S * np.arange(81)
    through = np.stack([0.3 * (np.arange(81) - 40), np.zeros(81)], axis=-1)
    through[35:45] = 0.0
    where = np.r_[through, np.zeros((81, 2))]
    assert not find_placeholders(np.r_[time_s, time_s], np.repeat([1, 2], 81), where).any()


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_lengths_in_another_unit_are_no_jumps(scale):
    time_s, track_id, position = crowd(3)
    position[5] = 0.0
    assert find_placeholders(time_s, track_id, scale * position).sum() == (scale == 1.0)


def test_in_a_bag_it_is_the_place_in_the_robots_frame_that_counts(ros2, tmp_path, caplog):
    instants = [(STEP_S * k, {"7": (8.0 + 0.3 * k, 1.0), "8": (0.0, 2.0 + 0.3 * k)}) for k in range(20)]
    for k in (4, 5, 11):
        instants[k][1]["7"] = (0.0, 0.0)
    path = bag(ros2, tmp_path / "bag", *instants, frame="laser", grid=False)
    with caplog.at_level(logging.WARNING):
        people = read_bag(path).trajectories
    assert (people.track_id == 7).sum() == 17
    assert (people.track_id == 8).sum() == 20
    assert "left out: 3 of 40 detections, at (0, 0)" in caplog.text
