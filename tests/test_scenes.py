"""Laws of recordings and occupancy maps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.scenes import Camera, OccupancyMap, Scene, Trajectories
from tests.refused import refused
from tests.scenes import maps


@given(maps(st.floats(-100.0, 100.0)))
def test_cell_centre_cell_centre(occupancy):
    cells = np.argwhere(np.ones_like(occupancy.occupied))
    centers = occupancy.center_of(cells)
    assert (occupancy.cell_of(centers) == cells).all()
    assert (occupancy.is_occupied(centers) == occupancy.occupied.reshape(-1)).all()


@given(maps(st.floats(-100.0, 100.0)), st.integers(1, 50))
def test_outside_is_free(occupancy, steps):
    full = OccupancyMap(np.ones_like(occupancy.occupied), occupancy.origin, occupancy.resolution_m)
    below = full.origin - steps * full.resolution_m * np.array([[1, 0], [0, 1], [1, 1]])
    above = full.origin + full.extent_m + steps * full.resolution_m * np.array([[1, 0], [0, 1], [1, 1]])
    assert not full.is_occupied(np.concatenate([below, above])).any()


def test_first_axis_is_x():
    occupancy = OccupancyMap([[False, False, True], [False, False, False]], [10.0, 20.0], 1.0)
    assert occupancy.is_occupied(np.array([10.5, 22.5]))
    assert not occupancy.is_occupied(np.array([12.5, 20.5]))
    assert occupancy.extent_m.tolist() == [2.0, 3.0]


@pytest.mark.parametrize(
    ("occupied", "origin", "resolution_m", "field"),
    [
        (np.ones(3), [0, 0], 0.1, "occupied"),
        (np.ones((2, 2)), [0, np.inf], 0.1, "origin"),
        (np.ones((2, 2)), [0, 1e300], 0.1, "origin"),
        (np.ones((2, 2)), [0, 0], 0.0, "resolution_m"),
        (np.broadcast_to(False, (9000, 9000)), [0, 0], 0.1, "occupied"),
    ],
)
def test_map_is_valid_from_birth(occupied, origin, resolution_m, field):
    with refused(field):
        OccupancyMap(occupied, origin, resolution_m)


@pytest.mark.parametrize("cell", [0.01, np.nan, 254])
def test_a_cell_that_is_neither_blocked_nor_free_is_refused(cell):
    with refused("occupied[0, 1]"):
        OccupancyMap([[0, cell]], [0, 0], 0.1)


def trajectories(**changed):
    values = {"time_s": [1.0, 0.0, 0.0], "track_id": [1, 2, 1], "position": [[1, 1], [2, 0], [0, 0]]}
    return Trajectories(**(values | changed))


def test_recording_is_sorted_by_time_then_track():
    sorted_ = trajectories(group_id=[7, 8, 7])
    assert sorted_.time_s.tolist() == [0.0, 0.0, 1.0]
    assert sorted_.track_id.tolist() == [1, 2, 1]
    assert sorted_.position.tolist() == [[0, 0], [2, 0], [1, 1]]
    assert sorted_.group_id.tolist() == [7, 8, 7]


@pytest.mark.parametrize("kind", [np.int64, np.uint64])
def test_large_track_ids_are_exact(kind):
    ids = [2**53, 2**53 + 1, 2**63 - 1]
    given = Trajectories(np.zeros(3), np.array(ids, kind), np.zeros((3, 2)))
    assert given.track_id.tolist() == ids


def test_selected_rows_stay_together():
    first = trajectories(goal=[[1, 2], [3, 4], [5, 6]])
    second = first.select(first.track_id == 1)
    assert second.position.tolist() == [[0, 0], [1, 1]]
    assert second.goal.tolist() == [[5, 6], [1, 2]]


@pytest.mark.parametrize(
    ("changed", "field"),
    [
        ({"track_id": [1, 2]}, "track_id"),
        ({"position": [[1, 1], [2, np.nan], [0, 0]]}, "position[1]"),
        ({"time_s": [1.0, 1.7e12, 0.0]}, "time_s[1]"),
        ({"position": [[1, 1], [2, 1.7e308], [0, 0]]}, "position[1]"),
        ({"track_id": np.array([1, 2, 2**63], np.uint64)}, "track_id[2]"),
        ({"track_id": [1, 2, 1.5]}, "track_id[2]"),
        ({"time_s": [0.0, 0.0, 0.0]}, ""),
        ({"goal": [[1, 1]]}, "goal"),
    ],
)
def test_recording_is_valid_from_birth(changed, field):
    with refused(field):
        trajectories(**changed)


def test_scene_is_valid_from_birth():
    occupancy = OccupancyMap(np.zeros((1, 1)), [0, 0], 1.0)
    with refused("name"):
        Scene("a/b", trajectories(), occupancy, 0.4)
    with refused("detection_dt_s"):
        Scene("a", trajectories(), occupancy, 0.0)
    with refused("picture"):
        Camera(None, np.zeros((2, 2), dtype=np.uint8))
    nobody = Trajectories(np.zeros(0), np.zeros(0, int), np.zeros((0, 2)))
    with refused(""):
        nobody.usual_interval_s()
