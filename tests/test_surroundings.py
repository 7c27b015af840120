"""History, nearest neighbours and beams: laws against plain loops."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.geometry import rotate
from pedpred.models.mixture.features.beams import obstacle_distances
from pedpred.models.mixture.features.history import past_positions
from pedpred.models.mixture.features.nearest import nearest_neighbours
from pedpred.scenes import OccupancyMap
from pedpred.tracking.spacing import SPACING_S, spaced

NOW, DT_S, STEPS = 10.0, 0.3, 8


def past_of(times_s, positions, now_s=NOW, velocity=(0.0, 0.0), heading=0.0):
    """The history of one person whose tracked position is the last detection."""
    times_s, positions = np.asarray(times_s, float), np.asarray(positions, float)
    kept = spaced(times_s, np.arange(len(times_s)))
    kept[-1] = False
    velocity = np.array([velocity], float)
    position = positions[-1:] + (now_s - times_s[-1]) * velocity
    rows = np.array([0]), np.array([kept.sum()])
    return past_positions(
        times_s[kept], positions[kept], *rows, times_s[-1:], positions[-1:], np.array([now_s]),
        position, velocity, np.array([heading]), STEPS, DT_S,
    )[0]  # fmt: skip


@given(st.integers(0, 10_000), st.floats(0.02, 1.0), st.integers(1, 80))
def test_a_history_interpolates_between_the_kept_detections(seed, interval_s, count):
    rng = np.random.default_rng(seed)
    times_s = NOW - interval_s * np.arange(count)[::-1]
    positions = np.cumsum(rng.normal(0, 0.1, (count, 2)), axis=0)
    heading = rng.uniform(-3, 3)
    past = past_of(times_s, positions, heading=heading)
    kept, last_s = [], -np.inf
    for k, time_s in enumerate(times_s):
        if time_s - last_s >= SPACING_S - 1e-6 or k == count - 1:
            kept.append(k)
            last_s = time_s
    for k in range(STEPS + 1):
        then_s = NOW - k * DT_S
        if then_s < times_s[0] - 1e-6:
            np.testing.assert_array_equal(past[k], 0)
            continue
        there = [np.interp(then_s, times_s[kept], positions[kept, axis]) for axis in range(2)]
        expected = rotate((np.array(there) - positions[-1])[None], np.array([-heading]))[0]
        np.testing.assert_allclose(past[k], [*expected, 1.0], atol=1e-4)


@given(st.integers(0, 10_000), st.integers(1, 12), st.floats(0.5, 10.0))
def test_the_nearest_are_found_in_the_order_of_their_distance(seed, count, range_m):
    rng = np.random.default_rng(seed)
    crowd, pace = 3 * rng.normal(size=(8, 2)), rng.normal(size=(8, 2))
    ids, heading = rng.permutation(8), 6 * rng.random(8)
    span = np.tile([0, 8], (8, 1))
    found = nearest_neighbours(crowd, heading, crowd, pace, ids, ids, span, count, range_m)
    for q in range(8):
        away = np.linalg.norm(crowd - crowd[q], axis=-1)
        order = [c for c in np.argsort(away) if c != q and away[c] < range_m][:count]
        expected = np.zeros((count, 5))
        for k, c in enumerate(order):
            relative = np.stack([crowd[c] - crowd[q], pace[c]])
            expected[k] = [
                *rotate(relative, np.full(2, -heading[q])).ravel(),
                min((range_m - away[c]) / 2.0, 1.0),
            ]
        np.testing.assert_allclose(found[q], expected, atol=1e-5)


@settings(max_examples=30)
@given(
    st.integers(0, 10_000), st.sampled_from([0.05, 0.1, 0.25]), st.booleans(), st.sampled_from([0.06, 0.5])
)
def test_beams_end_where_small_steps_meet_an_obstacle(seed, resolution_m, outside, share):
    rng = np.random.default_rng(seed)
    ground = OccupancyMap(rng.random((24, 31)) < share, rng.normal(size=2), resolution_m)
    position = (
        ground.origin + rng.uniform(-0.5 if outside else 0, 1.5 if outside else 1, (6, 2)) * ground.extent_m
    )
    heading = rng.uniform(-4, 4, 6)
    found = obstacle_distances(ground, position, heading, 16, 4.0)
    along = np.arange(0.0, 4.0, resolution_m / 200)
    for q in range(6):
        for b in range(16):
            angle = heading[q] + 2 * np.pi * b / 16
            points = position[q] + along[:, None] * [np.cos(angle), np.sin(angle)]
            cells = np.floor((points - ground.origin) / resolution_m).astype(int)
            inside = ((cells >= 0) & (cells < ground.occupied.shape)).all(axis=1)
            hit = np.zeros(len(along), bool)
            hit[inside] = ground.occupied[tuple(cells[inside].T)]
            hit &= np.logical_or.accumulate(~hit)
            expected = along[hit.argmax()] if hit.any() else 4.0
            # a beam may clip a corner between two of the small steps
            if found[q, b] < expected - resolution_m / 100:
                edge = position[q] + (found[q, b] + 1e-6) * np.array([np.cos(angle), np.sin(angle)])
                assert ground.occupied[tuple(np.floor((edge - ground.origin) / resolution_m).astype(int))]
            else:
                assert found[q, b] == pytest.approx(expected, abs=resolution_m / 100)
