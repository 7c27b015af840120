"""The rules that pick encounters find the planted one, and nothing where there is none."""

import numpy as np
import pytest

from pedpred.report.instants import before_obstacle, depth_m, mutual_avoidance
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from tests.forecasts import METHODS, windows_with

REFERENCE = METHODS.reference

AHEAD_S = (np.arange(10) + 1)[:, None] * 0.3


def windows_of(starts, velocities, aside_m):
    """People at one instant; the truth gives way by `aside_m` ([n, 2], m) over the 3 s."""
    starts, velocities, aside_m = (np.array(part, float) for part in (starts, velocities, aside_m))
    straight = starts[:, None] + velocities[:, None] * AHEAD_S
    truth = straight + aside_m[:, None] * np.minimum(AHEAD_S, 1.0)
    seen = {"track_id": np.arange(len(starts)) + 7, "velocity": velocities}
    return windows_with(starts, truth, {"kalman_cv": straight}, **seen)


FACING = windows_of([[2, 5], [6, 5], [2, 9]], [[1, 0], [-1, 0], [1, 0]], [[0, 0.5], [0, -0.5], [0, 0]])


def test_two_who_give_way_to_each_other_are_found():
    found = mutual_avoidance({"hall": FACING}, REFERENCE)
    assert (found.scene, found.who) == ("hall", 7)
    assert "7 and 8" in found.caption
    assert list(found.rows) == [0, 1, 2]


@pytest.mark.parametrize(
    ("velocities", "aside_m"),
    [
        ([[1, 0], [-1, 0]], [[0, 0.1], [0, -0.1]]),  # they touch
        ([[1, 0], [-1, 0]], [[0, 2.0], [0, -2.0]]),  # far apart
        ([[-1, 0], [1, 0]], [[0, 0.5], [0, -0.5]]),  # leaving each other
        ([[1, 0], [0.5, 0]], [[0, 0.5], [0, -0.5]]),  # one behind the other
        ([[1, 0], [-0.1, 0]], [[0, 0.5], [0, -0.5]]),  # one stands
    ],
)
def test_others_do_not_meet_so(velocities, aside_m):
    assert mutual_avoidance({"hall": windows_of([[2, 5], [4, 5]], velocities, aside_m)}, REFERENCE) is None


def hall():
    occupied = np.zeros((100, 100), bool)
    occupied[40:60, 40:60] = True
    nobody = Trajectories(np.zeros(0), np.zeros(0, int), np.zeros((0, 2)))
    return Scene("hall", nobody, OccupancyMap(occupied, np.zeros(2), 0.1), 0.4)


def test_depth_is_the_way_to_the_nearest_free_cell():
    points = np.array([[5.05, 5.05], [4.05, 5.05], [3.95, 5.05], [99.0, 0.0]])
    np.testing.assert_allclose(depth_m(points, hall().occupancy), [1.0, 0.1, 0.0, 0.0], atol=0.05)


def test_who_turns_before_an_obstacle_is_found_and_who_walks_through_is_not():
    windows = windows_of(
        [[3, 5.05], [3, 4.25], [3, 8], [2.9, 5.05]], [[1, 0]] * 4, [[-1.0, 2.5], [-1.0, -2.5], [0, 0], [0, 0]]
    )
    found = before_obstacle({"hall": windows}, {"hall": hall()}, REFERENCE)
    assert (found.scene, found.who) == ("hall", 7)
    assert (
        before_obstacle({"hall": windows_of([[3, 8]], [[1, 0]], [[0, 0]])}, {"hall": hall()}, REFERENCE)
        is None
    )
