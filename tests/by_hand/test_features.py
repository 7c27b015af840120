"""Steps, targets, windows of the past and neighbours: values written down by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.features import (
    FeatureTable,
    ForecastProtocol,
    Neighbours,
    Surroundings,
    extract_at_detections,
    extract_blocks,
    neighbours_at,
    surroundings,
)
from pedpred.features.extract import clock_steps, track_blocks
from pedpred.features.surroundings import Past, last_differences, pedestrians_at, present_rows
from pedpred.features.targets import Futures, future_velocities
from pedpred.scenes import Scene, Trajectories
from pedpred.tracking import KalmanSettings, follow
from tests.by_hand.lives import AGE, HEADING, PACE, SEEN, TIME_S, TRACK, TRACKED, scene_of, tracks_of
from tests.by_hand.walks import lagrange
from tests.worlds import empty_map, extract


def turned_back(vector, angle):
    """A world vector as seen from an agent frame."""
    x, y = np.moveaxis(np.asarray(vector, float), -1, 0)
    return np.stack([np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x], axis=-1)


# Targets


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_the_first_target_starts_at_the_tracked_position(dt_s):
    """(p(t + dt) - x) / dt, then (p(t + 2 dt) - p(t + dt)) / dt ..."""
    place = np.array([[1.0, 2.0], [-3.0, 0.5]])
    path = np.array([[[1.3, 2.2], [1.9, 2.1], [2.0, 3.0]], [[-3.1, 0.1], [-3.0, -0.6], [-2.6, -1.7]]])
    steps = [[[0.3, 0.2], [0.6, -0.1], [0.1, 0.9]], [[-0.1, -0.4], [0.1, -0.7], [0.4, -1.1]]]
    np.testing.assert_allclose(future_velocities(place, path, dt_s), np.array(steps) / dt_s)


def test_true_paths_are_cubic_within_pieces_and_end_with_them():
    """p(t) = (t - t^3, 2 t^2) of person 5 at four instants; a line, and a point, after gaps; person 2 apart.

    A cubic spline through four points, or a parabola through three, is the polynomial itself. Two steps of
    the first row lie within the piece up to 1.1 s; the last one within a microsecond.
    """
    t = np.array([0.0, 0.4, 0.7, 1.1])
    place = np.stack([t - t**3, 2 * t**2], axis=-1)
    time_s = np.array([*t, 1.8, 2.2, 4.0, 0.0, 0.3, 0.7])
    place = np.concatenate([place, [[5, 5], [6, 7], [9, 9]], [[0, 0], [0.9, 0.09], [2.1, 0.49]]])
    futures = Futures.of(Trajectories(time_s, np.repeat([5, 2], [7, 3]), place), 0.6)
    person = np.array([5, 5, 5, 2, 5, 2])
    now_s, ahead_s = np.array([0.25, 0.5000005, 1.9, 0.1, 4.0, 0.7]), np.array([0.3, 0.6, 0.9])
    path, known = futures.after(person, now_s, ahead_s)
    assert known.tolist() == [2, 2, 1, 2, 0, 0]
    at = np.array([0.55, 0.85, 1.1, 0.8000005, 1.1, 1.1])
    cubic = np.stack([at - at**3, 2 * at**2], axis=-1).reshape(2, 3, 2)
    np.testing.assert_allclose(path[:2], cubic, atol=1e-12)
    np.testing.assert_allclose(path[2], [[6, 7]] * 3)
    np.testing.assert_allclose(path[3], [[1.2, 0.16], [2.1, 0.49], [2.1, 0.49]], atol=1e-12)
    np.testing.assert_allclose(path[4:], [[[9, 9]] * 3, [[2.1, 0.49]] * 3])
    between, known = futures.after(np.array([5]), np.array([1.8]), np.array([0.1, 0.3]))
    np.testing.assert_allclose(between[0], [[5.25, 5.5], [5.75, 6.5]])
    assert (known.tolist(), known.dtype) == ([2], np.int8)
    path, known = futures.after(np.zeros(0, int), np.zeros(0), ahead_s)
    assert (path.shape, known.shape) == ((0, 3, 2), (0,))


def test_pieces_end_at_gaps_longer_than_truth_allows():
    """0.6 s are no gap and 0.7 s are one, unless people are lost sooner: then 0.4 s are one."""
    walk = Trajectories([0.0, 0.3, 0.9, 1.6], [1] * 4, np.outer([0.0, 0.3, 0.9, 1.6], [1.0, -0.5]))
    scene = Scene("gaps", walk, empty_map(), 0.3)
    for lost_s, gap_s, known in (
        (2.0, 0.6, [3, 2, 0, 0]),
        (2.0, 0.8, [5, 4, 2, 0]),
        (0.4, 0.6, [1, 0, 0, 0]),
    ):
        sizes = ForecastProtocol(lost_after_s=lost_s, truth_gap_s=gap_s)
        table = extract_at_detections(scene, follow(walk, "kalman", KalmanSettings(0.3, 0.1), 0.2), sizes)
        assert table.future_steps.tolist() == known
    usual = ForecastProtocol()
    assert (usual.dt_s, usual.horizon_steps, usual.min_history) == (0.3, 10, 3)
    assert (usual.max_age_intervals, usual.lost_after_s, usual.truth_gap_s) == (1.25, 2.0, 0.6)
    assert not usual.noncausal


def test_rows_at_detections_hold_states_and_targets_by_hand():
    """Row 1 is at 1.4 s, with known steps at 1.7, 2.0 and 2.3 s; row 2 at 1.8 s has one, at 2.1 s.

    The path of the first life is the cubic polynomial through its four detections, by Lagrange.
    """
    sizes = ForecastProtocol(horizon_steps=4, truth_gap_s=0.6)
    table = extract_at_detections(scene_of(), tracks_of(), sizes)
    assert table.step.tolist() == AGE.tolist()
    assert (table.step.dtype, table.phase.dtype) == (np.int32, np.int8)
    assert not table.phase.any()
    assert table.future_steps.tolist() == [4, 3, 1, 0, 1, 0, 0, 0]
    for name, values in {
        "track_id": TRACK,
        "time_s": TIME_S,
        "position": TRACKED,
        "last_position": SEEN,
    }.items():
        np.testing.assert_array_equal(getattr(table, name), values)
    np.testing.assert_array_equal(table.heading_rad, HEADING)
    np.testing.assert_allclose(table.velocity, turned_back(PACE, HEADING), atol=1e-6)

    truth = lagrange(TIME_S[:4], SEEN[:4], np.array([1.7, 2.0, 2.1]))
    path = np.array([TRACKED[1], truth[0], truth[1], SEEN[3]])
    expected = turned_back(np.diff(path, axis=0) / 0.3, 0.4)
    np.testing.assert_allclose(table.future[1], [*expected, [0, 0]], atol=1e-6)
    expected = turned_back((truth[2] - TRACKED[2]) / 0.3, 0.3)
    np.testing.assert_allclose(table.future[2], [expected, [0, 0], [0, 0], [0, 0]], atol=1e-6)
    np.testing.assert_allclose(table.future[4, 0], (SEEN[5] - TRACKED[4]) / 0.3, atol=1e-6)
    assert table.future.dtype == table.velocity.dtype == np.float32


def test_targets_are_the_path_of_the_person_behind_an_id():
    """Track 4 is person 9, whose true path is elsewhere: 0.3 s after 1.0 s at (2.3, 0.7)."""
    truth = Trajectories([1.0, 1.5, 1.0, 1.5], [9, 9, 4, 4], [[2, 1], [2.5, 0.5], [7, 7], [8, 8]])
    tracks = tracks_of(person_id=np.where(TRACK == 4, 9, 4))
    sizes = ForecastProtocol(horizon_steps=2)
    table = extract_at_detections(scene_of(), tracks, sizes, truth)
    np.testing.assert_allclose(
        table.future[0], [(np.array([2.3, 0.7]) - TRACKED[0]) / 0.3, [0, 0]], atol=1e-6
    )
    assert table.future_steps[[0, 1]].tolist() == [1, 0]


# Steps


def test_steps_count_from_each_first_detection_and_its_phases():
    """From 1.0 to 2.3 s: 1.0, 1.3 ... 2.2 s, 1.4, 1.7, 2.0, 2.3 s and 1.8, 2.1 s; 5.0 to 5.3 s: 5.0, 5.3 s.

    Track 7, seen from 0.9 to 1.02 s, has its first step only.
    """
    steps = clock_steps(tracks_of(), 0.4, 0.3, 3)
    expected_s = [1.0, 1.3, 1.6, 1.9, 2.2, 1.4, 1.7, 2.0, 2.3, 1.8, 2.1, 5.0, 5.3, 0.9]
    np.testing.assert_allclose(steps.time_s, expected_s, atol=1e-9)
    assert steps.track_id.tolist() == [4] * 13 + [7]
    assert steps.phase.tolist() == [0] * 5 + [1] * 4 + [2] * 2 + [0] * 3
    assert steps.step.tolist() == [0, 1, 2, 3, 4, 0, 1, 2, 3, 0, 1, 0, 1, 0]
    assert steps.row.tolist() == [0, 0, 1, 2, 2, 1, 1, 2, 3, 2, 2, 4, 5, 6]
    assert (steps.phase.dtype, steps.step.dtype) == (np.int8, np.int32)
    assert clock_steps(tracks_of(), 0.4, 0.4, 1).step.tolist() == [0, 1, 2, 3, 0, 0]
    assert clock_steps(tracks_of(), 0.4, 0.2, 1).step.tolist() == [0, 1, 2, 3, 4, 5, 6, 0, 1, 0]


def test_simultaneous_steps_are_equal_to_the_last_bit():
    """0.1 + 3 0.3 and 1.0 s; the last detection counts although it is half a microsecond early."""
    walks = Trajectories([0.1, 0.4, 0.9999995, 1.0, 1.3], [1, 1, 1, 2, 2], np.zeros((5, 2)))
    steps = clock_steps(follow(walks, "kalman", KalmanSettings(0.3, 0.1), 0.2), 0.3, 0.3, 1)
    assert steps.step.tolist() == [0, 1, 2, 3, 0, 1]
    assert steps.time_s[3] == steps.time_s[4]
    assert np.abs(steps.time_s * 1e6 % 1.0 - 0.5).min() > 0.49


def test_blocks_are_filled_with_whole_tracks():
    track = np.repeat([3, 5, 6, 9], [2, 3, 1, 4])
    for rows, ends in (
        (1, [2, 5, 6, 10]),
        (4, [2, 6, 10]),
        (5, [5, 10]),
        (6, [6, 10]),
        (9, [6, 10]),
        (10, [10]),
    ):
        blocks = list(track_blocks(track, rows))
        assert [block.stop for block in blocks] == ends
        assert [block.start for block in blocks] == [0, *ends[:-1]]
    assert list(track_blocks(track[:0], 5)) == [slice(0, 0)]


def reader(read):
    """Inputs of a model that reads whom it sees: the number of others, and the time step."""

    def compute(seen, dt_s):
        read.append(seen)
        there = np.diff(seen.around.span, axis=1)[:, 0]
        return {"unused": there, "there": there, "dt_s": np.full(len(there), dt_s), "age": seen.past.age}

    return SimpleNamespace(compute=compute, columns=lambda: {"dt_s": None, "there": None, "age": None})


def test_inputs_are_computed_where_the_steps_are():
    """A neighbour is there for 1.5 intervals of 0.4 s: at 1.0 and 1.3 s both tracks, later track 4 alone."""
    read, sizes = [], ForecastProtocol(max_age_intervals=1.5, horizon_steps=2)
    table = extract(scene_of(), tracks_of(), sizes, reader(read))
    assert list(table.inputs) == ["dt_s", "there", "age"]
    assert table.inputs["there"].tolist() == [2, 2, 2, 1, 1, 1, 1, 1]
    assert table.inputs["age"].tolist() == [0, 0, 1, 2, 2, 0, 1, 0]
    assert (table.inputs["dt_s"] == 0.3).all()
    late = np.array([0, 0.3, 0.2, 0.1, 0.4, 0, 0, 0])[:, None]
    expected = TRACKED[[0, 0, 1, 2, 2, 4, 5, 6]] + late * PACE[[0, 0, 1, 2, 2, 4, 5, 6]]
    np.testing.assert_allclose(table.position, expected, atol=1e-9)
    np.testing.assert_array_equal(read[0].observers.position, table.position)
    np.testing.assert_array_equal(read[0].time_s, table.time_s)
    blocks = list(extract_blocks(scene_of(), tracks_of(), sizes, reader(read), 7))
    assert [len(block) for block in blocks] == [7, 1]
    assert np.concatenate([block.inputs["there"] for block in blocks]).tolist() == [2, 2, 2, 1, 1, 1, 1, 1]


# The past and the neighbours


def test_motion_is_the_difference_of_the_last_detections():
    """v = (p_k - p_(k-1)) / dt, a = (v_k - v_(k-1)) / dt with the last dt; 0 where a life is too short."""
    velocity, acceleration = last_differences(tracks_of(), np.array([3, 2, 1, 0, 4, 5, 7]))
    v = np.array([[0.6, 1.6], [1.5, -0.25], [1.0, 0.5], [0, 0], [0, 0], [1, -1], [0.5, -2.5]])
    np.testing.assert_allclose(velocity, v, atol=1e-12)
    expected = [(v[0] - v[1]) / 0.5, (v[1] - v[2]) / 0.4, *np.zeros((5, 2))]
    np.testing.assert_allclose(acceleration, expected, atol=1e-9)
    burst = tracks_of(time_s=np.array([1.0, 1.02, 1.06, 1.08, 5.0, 5.04, 0.9, 0.95]))
    velocity, acceleration = last_differences(burst, np.array([1, 2, 3, 5]))
    walked = np.array([SEEN[1] - SEEN[0], SEEN[2] - SEEN[0], SEEN[3] - SEEN[0], SEEN[5] - SEEN[4]])
    np.testing.assert_allclose(velocity, walked / np.array([[0.05], [0.06], [0.08], [0.05]]))
    assert not acceleration.any()


def test_a_past_holds_the_kept_detections_of_its_own_life():
    """Of a burst at 1.0, 1.02, 1.4 and 1.8 s the second one is left out."""
    tracks = tracks_of(time_s=np.array([1.0, 1.02, 1.4, 1.8, 5.0, 5.3, 0.9, 1.02]))
    rows = np.array([3, 2, 1, 0, 5, 7])
    past = Past.of(tracks, rows)
    np.testing.assert_array_equal(past.trail_s, [1.0, 1.4, 1.8, 5.0, 5.3, 0.9, 1.02])
    np.testing.assert_array_equal(past.trail, SEEN[[0, 2, 3, 4, 5, 6, 7]])
    assert past.span.tolist() == [[0, 2], [0, 1], [0, 1], [0, 0], [3, 4], [5, 6]]
    assert past.age.tolist() == [2, 1, 1, 0, 1, 1]
    np.testing.assert_array_equal(past.seen_s, tracks.time_s[rows])
    np.testing.assert_array_equal(past.seen, SEEN[rows])
    np.testing.assert_array_equal(past.last_velocity, last_differences(tracks, rows)[0])
    np.testing.assert_array_equal(past.covariance, tracks.covariance[rows])


PEOPLE, PEOPLE_S = np.array([1, 1, 1, 2, 2, 6]), np.array([0.0, 0.4, 1.2, 0.1, 0.5, 0.4])


@pytest.mark.parametrize("candidates", [2**20, 4, 1])
def test_present_is_whose_last_detection_is_young_enough(monkeypatch, candidates):
    """At 0.4, 0.5, 0.9, 1, 1.3 and 3 s, up to 0.5 s old; by whole instants in bounded memory."""
    monkeypatch.setattr(surroundings, "_MOST_CANDIDATES", candidates)
    rows, at = present_rows(PEOPLE, PEOPLE_S, np.array([0.4, 0.5, 0.9, 1.0, 1.3, 3.0]), 0.5)
    found = sorted(zip(at.tolist(), rows.tolist(), strict=True))
    assert found == [(0, 1), (0, 3), (0, 5), (1, 1), (1, 4), (1, 5), (2, 1), (2, 4), (2, 5), (3, 4), (4, 2)]
    assert (np.diff(at) >= 0).all()


def test_a_detection_counts_within_a_microsecond_of_the_present():
    early = present_rows(PEOPLE, PEOPLE_S, np.array([0.4 - 3e-6, 0.4 - 5e-7]), 0.4)
    assert [column.tolist() for column in early] == [[0, 3, 3, 1, 5], [0, 0, 1, 1, 1]]
    none = present_rows(PEOPLE[:0], PEOPLE_S[:0], np.array([0.4]), 0.5)
    assert [len(column) for column in none] == [0, 0]
    assert [len(column) for column in present_rows(PEOPLE, PEOPLE_S, np.zeros(0), 0.5)] == [0, 0]


def test_neighbours_are_extrapolated_to_each_instant():
    """At 1.9 s track 4 is 0.1 s ahead; at 1.2 s it is 0.2 s ahead, and track 7, seen at 1.02 s, 0.18 s."""
    around = neighbours_at(tracks_of(), np.array([1.9, 1.2, 1.9, 9.0]), 0.3)
    assert around.track_id.tolist() == [4, 7, 4]
    assert around.span.tolist() == [[2, 3], [0, 2], [2, 3], [3, 3]]
    order = np.argsort(around.track_id[:2])
    ahead = [TRACKED[0] + 0.2 * PACE[0], TRACKED[7] + 0.18 * PACE[7]]
    np.testing.assert_allclose(around.position[:2][order], ahead)
    np.testing.assert_allclose(around.position[2], TRACKED[2] + 0.1 * PACE[2])
    np.testing.assert_array_equal(around.velocity[:2][order], PACE[[0, 7]])
    seen = Surroundings.of(tracks_of(), np.array([2, 7]), np.array([1.9, 1.3]), around, empty_map())
    expected = [TRACKED[2] + 0.1 * PACE[2], TRACKED[7] + 0.28 * PACE[7]]
    np.testing.assert_allclose(seen.observers.position, expected)
    np.testing.assert_array_equal(seen.observers.heading_rad, HEADING[[2, 7]])
    np.testing.assert_array_equal(seen.past.seen, SEEN[[2, 7]])
    frame = pedestrians_at(tracks_of(), np.array([1, 5, 7]), np.array([1.4, 5.3, 1.02]))
    both = Neighbours.of_crowd(frame, 2)
    assert both.span.tolist() == [[0, 3], [0, 3]]
    np.testing.assert_array_equal(both.velocity, PACE[[1, 5, 7]])


def test_rows_are_joined_and_selected_with_their_inputs():
    table = extract(scene_of(), tracks_of(), ForecastProtocol(horizon_steps=2), reader([]))
    assert len(table) == 8
    picked = FeatureTable.join([table.select(np.array([6, 2])), table.select(np.arange(8) == 4)])
    for name, values in {**picked.columns, **picked.inputs}.items():
        whole = {**table.columns, **table.inputs}[name]
        np.testing.assert_array_equal(values, whole[[6, 2, 4]])
    assert "inputs" not in picked.columns
    assert (len(picked.columns), len(picked.inputs)) == (12, 3)
    with pytest.raises(ValueRuleError):
        replace(table, inputs={"there": np.zeros(7)})
