"""History, nearest neighbours and beams of the mixture network: values written down by hand."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.features.surroundings import Neighbours, Past, Pedestrians, Surroundings
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.models.mixture.features.beams import obstacle_distances
from pedpred.models.mixture.features.history import _look_back, past_positions
from pedpred.models.mixture.features.nearest import _collect, nearest_neighbours
from pedpred.scenes import OccupancyMap

TURNED = np.arctan2(0.8, 0.6)
"""A heading along (0.6, 0.8): forward is 0.6 x + 0.8 y, left is 0.6 y - 0.8 x."""
TRAIL_S = np.array([1.0, 4.0, 4.5, 5.3, 8.0, 9.1])
TRAIL = np.array([[9.0, 9.0], [1.0, 2.0], [1.5, 1.0], [2.3, 2.6], [7.0, 7.0], [4.0, 4.0]])


def look_back(now_s, dt_s, steps=3, trail_s=TRAIL_S, first=1, seen_s=6.0):
    """One person, seen at (3, 2) and tracked at (3.1, 1.8); rows 1 to 3 of the trail are its own."""
    one = np.ones(1)
    return past_positions(
        trail_s, TRAIL, np.array([first]), np.array([4]), seen_s * one, np.array([[3.0, 2.0]]), now_s * one,
        np.array([[3.1, 1.8]]), np.array([[0.5, -1.25]]), TURNED * one, steps, dt_s,
    )[0]  # fmt: skip


def turned(places):
    """World places as seen from (3.1, 1.8) along (0.6, 0.8)."""
    x, y = (np.asarray(places, float) - [3.1, 1.8]).T
    return np.stack([0.6 * x + 0.8 * y, 0.6 * y - 0.8 * x], axis=-1)


def test_history_after_the_last_detection_is_extrapolated():
    """Now 6.7 s, dt 0.3 s: 6.7, 6.4 and 6.1 from (3.1, 1.8) back along (0.5, -1.25) m/s; 5.8 is 5/7."""
    found = look_back(6.7, 0.3)
    places = [[3.1, 1.8], [3.1 - 0.15, 1.8 + 0.375], [3.1 - 0.3, 1.8 + 0.75]]
    places.append([2.3 + 5 / 7 * 0.7, 2.6 - 5 / 7 * 0.6])
    np.testing.assert_allclose(found, np.column_stack([turned(places), np.ones(4)]), atol=1e-6)


def test_history_does_not_depend_on_when_time_begins():
    """The same detections, 8 s earlier: some times are below 0."""
    early = look_back(-2.0, 0.4, steps=6, trail_s=TRAIL_S - 8.0, seen_s=-2.0)
    np.testing.assert_allclose(early, look_back(6.0, 0.4, steps=6), atol=1e-6)


@pytest.mark.parametrize("late_s", [5e-7, -5e-7])
def test_half_a_microsecond_makes_no_other_instant(late_s):
    """The last and the first detection count as those of 6.0 and 4.0 s; 3 microseconds are too much."""
    trail_s = TRAIL_S + late_s * (TRAIL_S == 4.0)
    found = look_back(6.0, 1.0, steps=2, trail_s=trail_s, seen_s=6.0 + late_s)
    expected = turned([[3.0, 2.0], [1.5 + 0.5, 1.0 + 1.0], [1.0, 2.0]])
    np.testing.assert_allclose(found, np.column_stack([expected, np.ones(3)]), atol=1e-5)
    alone = look_back(6.0, 1.0, first=4, seen_s=6.0 + late_s)
    assert alone[:, 2].tolist() == [1, 0, 0, 0]
    trail_s = TRAIL_S + 6 * late_s * (TRAIL_S == 4.0)
    assert look_back(6.0, 1.0, steps=2, trail_s=trail_s)[2].any() == (late_s < 0)
    tracked = look_back(6.0, 1.0, steps=2, seen_s=6.0 - 3e-6)[0]
    np.testing.assert_allclose(tracked, [0.0, 0.0, 1.0], atol=1e-5)


def test_histories_of_several_people_are_their_own():
    """The second one, at (1, 1) along x, has only its last detection, 0.3 s before the present.

    The third one, at (4, 5) along y, was seen at (7, 7) at 8 s and at (4, 4) at 9.1 s.
    """
    found = past_positions(
        TRAIL_S, TRAIL, np.array([1, 4, 4]), np.array([4, 4, 5]), np.array([6.0, 7.0, 9.1]),
        np.array([[3.0, 2.0], [0.5, 0.5], [4.0, 4.0]]), np.array([6.0, 7.3, 9.1]),
        np.array([[3.1, 1.8], [1.0, 1.0], [4.0, 5.0]]), np.array([[0.5, -1.25], [9.0, 9.0], [9.0, 9.0]]),
        np.array([TURNED, 0.0, np.pi / 2]), 2, 0.3,
    )  # fmt: skip
    np.testing.assert_array_equal(found[0], look_back(6.0, 0.3, steps=2))
    np.testing.assert_allclose(found[1], [[0, 0, 1], [-0.5, -0.5, 1], [0, 0, 0]], atol=1e-6)
    late = [0.3 / 1.1 * 3.0, 0.6 / 1.1 * 3.0]  # m towards (7, 7), in x and y
    expected = [[-1, 0, 1], [late[0] - 1, -late[0], 1], [late[1] - 1, -late[1], 1]]
    np.testing.assert_allclose(found[2], expected, atol=1e-6)


CROWD = np.array([[50.0, 50.0], [5.5, 2.0], [2.0, 5.5], [3.0, 2.0], [6.0, 6.0], [0.06, -1.92], [3.0, -1.5]])
PACE = np.array([[9.0, 9.0], [1.0, 0.0], [0.0, 2.0], [5.0, 5.0], [7.0, 7.0], [-1.0, 0.5], [0.3, -0.4]])
CROWD_TRACK = np.array([3, 8, 7, 3, 1, 2, 5])


def test_neighbours_are_listed_with_place_velocity_and_weight():
    """From (3, 2) along (0.6, 0.8), as far as 5 m: away 2.5, 3.5, sqrt(13.25) and 4.9 m.

    Track 1 is exactly 5 m away and left out, as are the own track 3 and row 0 of another instant.
    The weight falls from 1 at 3 m to 0 at 5 m: 1, 0.75, 0.68 and 0.05.
    """
    found = nearest_neighbours(
        np.array([[3.0, 2.0]]), np.array([TURNED]), CROWD, PACE, CROWD_TRACK, np.array([3]),
        np.array([[1, 7]]), 5, 5.0,
    )[0]  # fmt: skip
    x, y = np.array([2.5, 0.0, -1.0, -2.94]), np.array([0.0, -3.5, 3.5, -3.92])
    vx, vy = np.array([1.0, 0.3, 0.0, -1.0]), np.array([0.0, -0.4, 2.0, 0.5])
    expected = np.zeros((5, 5))
    expected[:4, 0], expected[:4, 1] = 0.6 * x + 0.8 * y, 0.6 * y - 0.8 * x
    expected[:4, 2], expected[:4, 3] = 0.6 * vx + 0.8 * vy, 0.6 * vy - 0.8 * vx
    expected[:4, 4] = [1.0, 0.75, (5.0 - np.sqrt(13.25)) / 2.0, 0.05]
    np.testing.assert_allclose(found, expected, atol=1e-6)
    two = nearest_neighbours(
        np.array([[9.0, 9.0], [3.0, 2.0]]), np.array([0.3, TURNED]), CROWD, PACE, CROWD_TRACK,
        np.array([0, 3]), np.array([[0, 1], [1, 7]]), 2, 5.0,
    )  # fmt: skip
    assert not two[0].any()
    np.testing.assert_allclose(two[1], expected[:2], atol=1e-6)


@pytest.mark.parametrize("tracks", [[6, 4, 9], [9, 6, 4], [4, 9, 6]])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_neighbours_at_equal_distance_are_listed_by_track(tracks, count):
    """All are 1 m away, and the lowest track comes first."""
    crowd = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    found = nearest_neighbours(
        np.zeros((1, 2)), np.zeros(1), crowd, np.zeros((3, 2)), np.array(tracks), np.array([0]),
        np.array([[0, 3]]), count, 3.5,
    )[0]  # fmt: skip
    np.testing.assert_allclose(found[:, :2], crowd[np.argsort(tracks)][:count], atol=1e-7)
    np.testing.assert_array_equal(found[:, 4], 1.0)


def test_loops_stay_within_their_arrays():
    """The plain loops, whose indices Python checks, give what the compiled ones give.

    Seven people for a list of two; and a person without earlier detections, at the beginning of the trail.
    """
    collect, look = (getattr(loop, "py_func", loop) for loop in (_collect, _look_back))
    place, span = np.array([[3.0, 2.0]]), np.array([[0, 7]])
    about = place, np.zeros(1), CROWD, PACE, CROWD_TRACK, np.array([3]), span
    neighbours = np.zeros((1, 2, 5), np.float32)
    collect(*about, 100.0, neighbours)
    np.testing.assert_array_equal(neighbours, nearest_neighbours(*about, 2, 100.0))
    none, one = np.zeros(1, int), np.ones(1)
    about = TRAIL_S + 9.0, TRAIL, none, none, 6 * one, place, 6 * one, place, place, one
    history = np.zeros((1, 4, 3), np.float32)
    look(*about, 0.3, history)
    np.testing.assert_array_equal(history, past_positions(*about, 3, 0.3))


# 8 x 5 cells of 0.5 m from (10, -2): x from 10 to 14 and y from -2 to 0.5, blocked where "#".
GROUND = OccupancyMap(
    np.array([list(row) for row in ["........", "##......", "##..#.##", "........", ".....#.#"]]).T == "#",
    np.array([10.0, -2.0]),
    0.5,
)  # row j is y from -2 + 0.5 j


@pytest.mark.parametrize(
    ("place", "heading", "distances"),
    [
        # free, in cell (3, 2): (4, 2) begins at x = 12; nothing above or below; (1, 2) ends at x = 11
        ((11.75, -0.875), 0.0, [0.25, 3.0, 0.75, 3.0]),
        # inside (0, 2): the block ends at x = 11, then (4, 2) at x = 12; downwards only (0, 1) and the end
        ((10.25, -0.75), 0.0, [1.75, 3.0, 3.0, 3.0]),
        # inside (6, 2): right all is blocked up to the border; left (5, 2) is free, (4, 2) ends at 12.5
        ((13.375, -0.75), 0.0, [3.0, 3.0, 0.875, 3.0]),
        # inside (7, 4): upwards it ends, downwards (7, 3) is free, (7, 2) ends at y = -0.5; left (5, 4) at 13
        ((13.75, 0.125), 0.0, [3.0, 3.0, 0.75, 0.625]),
        # outside, left of the map: the block at its border counts
        ((8.0, -1.125), 0.0, [2.0, 3.0, 3.0, 3.0]),
        # outside, below the map, along y: (4, 2) begins at y = -1
        ((12.125, -2.5), np.pi / 2, [1.5, 3.0, 3.0, 3.0]),
        # the same from y = -4: exactly as far as the range, and 1 mm nearer
        ((12.125, -4.0), np.pi / 2, [3.0, 3.0, 3.0, 3.0]),
        ((12.125, -3.999), np.pi / 2, [2.999, 3.0, 3.0, 3.0]),
        # outside, right: (7, 2) ends at x = 14, backwards
        ((15.5, -0.875), np.pi, [1.5, 3.0, 3.0, 3.0]),
        # outside, below the map, in its first column: (0, 1) begins at y = -1.5
        ((10.25, -2.5), np.pi / 2, [1.0, 3.0, 3.0, 3.0]),
        # outside, above the map, beside (5, 4), which counts for none; downwards (4, 2) ends at y = -0.5
        ((12.25, 0.75), 0.0, [3.0, 3.0, 3.0, 1.25]),
        # outside, beside the map and along it: nothing
        ((9.0, 0.75), 0.0, [3.0, 3.0, 3.0, 3.0]),
        ((9.75, -2.5), np.pi / 2, [3.0, 3.0, 3.0, 3.0]),
    ],
)  # fmt: skip
def test_beams_along_the_axes_end_at_edges_of_cells(place, heading, distances):
    found = obstacle_distances(GROUND, np.array([place]), np.array([heading]), 4, 3.0)
    np.testing.assert_allclose(found, [distances], atol=1e-6)


def test_oblique_beams_end_at_edges_of_cells():
    """From (11.75, -0.25) along (3, -4) / 5: y = -0.5 after 0.3125 at x = 11.9375 in the free cell (3, 2).

    It enters (4, 2) at x = 12 after 0.25 / 0.6. Along (-3, -4) / 5, from the same place, y = -0.5 comes at
    x = 11.5625 and x = 11 after 1.25, at y = -1.25, in (1, 1). Along (4, 3) / 5 it enters (4, 4), which is
    free, and (5, 4) at x = 12.5 after 0.9375, at y = 0.3125. Along (-4, 3) / 5 there is nothing.
    """
    start, down, up = np.array([[11.75, -0.25]]), np.arctan2(-4.0, 3.0), np.arctan2(3.0, 4.0)
    for heading, distance in {down: 0.25 / 0.6, np.pi - down: 1.25, up: 0.9375, np.pi - up: 4.0}.items():
        found = obstacle_distances(GROUND, start, np.array([heading]), 1, 4.0)
        np.testing.assert_allclose(found, [[distance]], atol=1e-6)


def first_hit(ground, place, way, range_m):
    """A beam is in cell (i, j) where both coordinates are; blocked cells at its start are left first."""
    counts = [np.arange(n) for n in ground.occupied.shape]
    edges = [np.stack([n, n + 1.0]) * ground.resolution_m for n in counts]
    one, two = ((e + o - p) / w for e, o, p, w in zip(edges, ground.origin, place, way, strict=True))
    enter = np.maximum(one.min(axis=0)[:, None], two.min(axis=0))
    leave = np.minimum(one.max(axis=0)[:, None], two.max(axis=0))
    met = (np.maximum(enter, 0.0) < leave) & (enter < range_m)
    order = np.argsort(enter[met])
    blocked, at = ground.occupied[met][order], enter[met][order]
    if len(at) and at[0] < 0:
        blocked &= np.logical_or.accumulate(~blocked)
    return at[blocked.argmax()] if blocked.any() else range_m


def test_beams_in_all_directions_end_where_a_cell_is_entered():
    rng = np.random.default_rng(4)
    blocked = rng.random((7, 11)) < 0.3
    ground = OccupancyMap(blocked, np.array([-3.0, 5.0]), 0.4)
    place = ground.origin + rng.uniform(-0.4, 1.4, (60, 2)) * ground.extent_m
    heading = rng.uniform(-9.0, 9.0, 60)
    found = obstacle_distances(ground, place, heading, 12, 3.1)
    angle = heading[:, None] + 2 * np.pi * np.arange(12) / 12
    ways = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    expected = [[first_hit(ground, place[q], way, 3.1) for way in ways[q]] for q in range(60)]
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert found.dtype == np.float32
    assert found.max() == np.float32(3.1)  # 3.1 / 0.4 * 0.4 is more


def seen_by_two(dt_s):
    """Two people, at (11.75, -0.875) along x and at (3, 2) along (0.6, 0.8), and what surrounds them."""
    who = Pedestrians(
        np.array([4, 3]), np.array([[11.75, -0.875], [3.0, 2.0]]), np.array([0.0, TURNED]),
        np.array([[1.5, -0.5], [0.5, 1.0]]),
    )  # fmt: skip
    past = Past(
        np.linspace(6.0, 7.2, 13), np.linspace([1.8, 0.8], [3.0, 3.2], 13), np.array([[0, 3], [1, 13]]),
        np.array([7.3, 7.3]), np.array([[11.7, -0.8], [3.1, 3.4]]), np.array([[2.0, 1.0], [-1.0, 2.0]]),
        np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]),
    )  # fmt: skip
    around = Neighbours(CROWD_TRACK, CROWD, PACE, np.array([[0, 1], [1, 7]]))
    seen = Surroundings(who, past, np.array([7.3, 7.3]), around, GROUND)
    return seen, MixtureFeatures(2, 2, 5.0, 4, 3.0).compute(seen, dt_s)


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_inputs_are_computed_in_the_agent_frame(dt_s):
    """Age: min(3, 10) / 10 and min(12, 10) / 10. (0.5, 1) m/s is (1.1, 0.2) in the agent frame."""
    seen, found = seen_by_two(dt_s)
    np.testing.assert_allclose(found["state"], [[1.5, -0.5], [1.1, 0.2]], atol=1e-6)
    track = [[2.0, 1.0, 0.1, 0.2, 0.3, 0.3], [1.0, 2.0, 0.4, 0.5, 0.6, 1.0]]
    np.testing.assert_allclose(found["track"], track, atol=1e-6)
    history = found["history"].reshape(2, 3, 3)
    x, y = np.array([0.1, 1.4])  # seen at (3.1, 3.4), from (3, 2)
    np.testing.assert_allclose(history[1, 0], [0.6 * x + 0.8 * y, 0.6 * y - 0.8 * x, 1], atol=1e-6)
    x, y = np.array([0.1, 1.4]) - dt_s * np.array([1.0, 2.0])
    np.testing.assert_allclose(history[1, 1], [0.6 * x + 0.8 * y, 0.6 * y - 0.8 * x, 1], atol=1e-5)
    people = found["neighbours"].reshape(2, 2, 5)
    assert not people[0].any()
    np.testing.assert_allclose(people[1, :, 4], [1.0, 0.75])
    np.testing.assert_allclose(people[1, 0, :2], [1.5, -2.0], atol=1e-6)
    np.testing.assert_allclose(found["beams"], [[0.25, 3.0, 0.75, 3.0], [3.0] * 4], atol=1e-6)
    sizes = replace(MixtureFeatures(2, 2, 5.0, 4, 3.0), beam_range_m=2.0)
    own = sizes.obstacle_inputs(GROUND, seen.observers.position, seen.observers.heading_rad)
    np.testing.assert_allclose(own["beams"], [[0.25, 2.0, 0.75, 2.0], [2.0] * 4], atol=1e-6)
    assert all(found[name].shape == (2, *shape) for name, shape in sizes.shapes().items())
    assert {values.dtype for values in found.values()} == {np.dtype(np.float32)}
    for same in (sizes.channels(found), sizes.graph_inputs(found)):
        assert all(np.array_equal(same[name], values) for name, values in found.items())


def test_sizes_of_inputs_follow_their_settings():
    """(3 + 1) past positions of 3 numbers, 7 neighbours of 5, 12 beams; 3 steps of 0.4 s are 1.2 s."""
    sizes = MixtureFeatures(history_steps=3, neighbours=7, beams=12)
    expected = {"state": (2,), "history": (12,), "track": (6,), "neighbours": (35,), "beams": (12,)}
    assert sizes.shapes() == expected
    kinds = {name: column.dtype for name, column in sizes.columns().items()}
    assert kinds == dict.fromkeys(expected, "float32") | dict.fromkeys(("neighbours", "beams"), "float16")
    assert (sizes.past_s(0.3), sizes.past_s(0.4)) == pytest.approx((0.9, 1.2))
