"""Occupancy crop, angular pedestrian grid and channels of the LSTM: values written down by hand."""

import numpy as np
import pytest

from pedpred.features.surroundings import Neighbours, Past, Pedestrians, Surroundings
from pedpred.models.lstm.features import LstmFeatures
from pedpred.models.lstm.features.grids import _rough_angle, angular_grids, occupancy_crops, unpack_crops
from pedpred.scenes import OccupancyMap

TURNED = np.arctan2(0.8, 0.6)
"""A heading along (0.6, 0.8); left of it is (-0.8, 0.6)."""
MAP = OccupancyMap(
    np.array([[1, 0, 0, 1], [0, 0, 1, 0], [0, 1, 0, 0], [0, 0, 1, 1], [1, 0, 0, 0]], bool),
    np.array([-1.0, 2.0]),
    0.5,
)
"""Five cells along x, from -1 to 1.5 m; four along y, from 2 to 4 m."""


def crops(position, heading_rad, cells=4, resolution_m=0.5, ground=MAP):
    packed = occupancy_crops(ground, np.array(position, float), np.array(heading_rad), cells, resolution_m)
    return packed, unpack_crops(packed, cells)


@pytest.mark.parametrize("resolution_m", [0.3, 0.5, 0.8])
def test_crops_are_forward_by_left_around_each_person(resolution_m):
    """p = x + f (c, s) + l (-s, c); its cell is floor((p - origin) / 0.5 m). Around the map all is free."""
    place = np.array([[0.13, 2.81], *[[0.0, 3.0]] * 4, [1.49, 3.98], [-0.99, 2.02]])
    way = np.array([[0.6, 0.8], [1, 0], [0, 1], [-1, 0], [0, -1], [1, 0], [1, 0]])
    _, found = crops(place, np.arctan2(way[:, 1], way[:, 0]), 8, resolution_m)
    for n, i, j in np.ndindex(7, 8, 8):
        f, left = (i + 0.5 - 4) * resolution_m, (j + 0.5 - 4) * resolution_m
        at = place[n] + f * way[n] + left * np.array([-way[n, 1], way[n, 0]])
        k, m = np.floor((at - [-1.0, 2.0]) / 0.5).astype(int)
        assert found[n, i, j] == (0 <= k < 5 and 0 <= m < 4 and MAP.occupied[k, m])
    assert (found.sum(axis=(1, 2)) >= 2).all()


def test_bits_are_cells_row_by_row_least_significant_first():
    """[[1, 0, 0, 1], [0, 0, 1, 0]] is 0b01001001, [[0, 1, 0, 0], [0, 0, 1, 1]] is 0b11000010."""
    packed, _ = crops([[0.0, 3.0]], [0.0])
    assert packed.dtype == np.uint8
    assert packed.tolist() == [[0b01001001, 0b11000010]]
    assert unpack_crops(np.array([[0b00010011, 0b10000000]], np.uint8), 4).tolist() == [
        [[1, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]]
    ]


def test_a_far_obstacle_is_in_the_cell_of_its_place():
    """Cells of 1 m: 12 of them from -6 m; the one at 3 to 4 m forward and -2 to -1 m left is (9, 4)."""
    ground = OccupancyMap(np.ones((1, 1), bool), np.array([10.0, -5.0]), 1.0)
    _, found = crops([[6.5, -3.1]], [0.0], 12, 1.0, ground)
    assert np.argwhere(found[0]).tolist() == [[9, 4]]  # centre at 3.5 m and -1.5 m: (10, -4.6)


def apg(crowd, heading_rad=0.0, cells=8, max_range_m=5.0, position=(0.0, 0.0)):
    everybody, rows = np.array(crowd, float).reshape(-1, 2), len(crowd)
    return angular_grids(
        np.array([position]), np.array([heading_rad]), everybody, np.arange(rows), np.array([-1]),
        np.array([[0, rows]]), cells, max_range_m,
    )[0]  # fmt: skip


def polar(distance, degrees):
    return [distance * np.cos(np.deg2rad(degrees)), distance * np.sin(np.deg2rad(degrees))]


def test_each_cone_has_its_nearest_pedestrian_up_to_the_range():
    """K = 8, cone k is [45 k, 45 k + 45) degrees. Three people are in cone 0; from 5 m on nobody counts."""
    crowd = [polar(*one) for one in [(2.5, 10), (1.5, 30), (4.0, 44), (3.25, 50), (5.5, 140), (4.75, 179)]]
    crowd += [polar(*one) for one in [(0.5, 185), (5.0, 250), (7.0, 280), (2.25, 359)]]
    found = apg(crowd)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, [1.5, 3.25, 5.0, 4.75, 0.5, 5.0, 5.0, 2.25], rtol=1e-6)


def test_cones_turn_with_the_heading_and_begin_at_it():
    """From (1, -2) along 100 degrees: 130 is cone 0, 99 is cone 7, 281 is cone 4, 191 is cone 2."""
    where = np.array([1.0, -2.0])
    crowd = where + np.array([polar(2.0, 130), polar(3.0, 99), polar(1.5, 281), polar(4.0, 191)])
    for turns in (0, 1, -1, 5):
        found = apg(crowd, np.deg2rad(100 + 360 * turns), position=where)
        np.testing.assert_allclose(found, [2, 5, 4, 5, 1.5, 5, 5, 3], rtol=1e-6)


def test_an_edge_belongs_to_the_cone_that_begins_there():
    """K = 4, at exactly 90, 180, 270 and 0 degrees; a person at the same point is towards world x."""
    crowd = [[0.0, 2.0], [-3.0, 0.0], [0.0, -4.0], [1.0, 0.0], [9.0, 9.0]]
    np.testing.assert_allclose(apg(crowd, cells=4), [1, 2, 3, 4])
    np.testing.assert_allclose(apg([[-3.0, -0.0]], cells=4), [5, 5, 3, 5])
    np.testing.assert_allclose(apg([[0.0, 0.0]], np.deg2rad(100), cells=4), [5, 5, 0, 5])


@pytest.mark.parametrize("cells", [72, 360])
def test_cones_are_exact_to_a_millionth_of_a_radian(cells):
    """One person 1e-6 rad behind the beginning of each cone and one before its end, alone each."""
    edge = 0.37 + np.arange(cells) * 2 * np.pi / cells
    for off, shift in ((1e-6, 0), (-1e-6, -1)):
        crowd = 2.5 * np.stack([np.cos(edge + off), np.sin(edge + off)], axis=-1)
        span = np.stack([np.arange(cells), np.arange(cells) + 1], axis=-1)
        found = angular_grids(
            np.zeros((cells, 2)), np.full(cells, 0.37), crowd, np.zeros(cells, int), np.full(cells, 9), span,
            cells, 6.0,
        )  # fmt: skip
        np.testing.assert_array_equal(np.argmin(found, axis=1), (np.arange(cells) + shift) % cells)
        assert ((found < 6.0).sum(axis=1) == 1).all()


def test_rough_angle_is_within_a_hundred_thousandth():
    """Hastings 1955: the error of this polynomial is at most 1e-5, in all quadrants."""
    angles = np.linspace(-3.14159, 3.14159, 997)
    found = np.array([_rough_angle(0.7 * np.cos(a), 0.7 * np.sin(a)) for a in angles])
    np.testing.assert_allclose(found, angles, atol=1.15e-5, rtol=0)
    axes = [_rough_angle(x, y) for x, y in ((2.0, 0.0), (0.0, 2.0), (-2.0, 0.0), (0.0, -2.0), (0.0, 0.0))]
    np.testing.assert_allclose(axes, [0.0, np.pi / 2, np.pi, -np.pi / 2, 0.0], atol=1e-12)


def test_everybody_sees_others_of_the_own_instant():
    """Rows 0 and 1 are another instant; tracks 5 and 7 see one another, and track 6, but not themselves."""
    crowd = np.array([[0.1, 0.1], [0.3, 0.2], [1.0, 1.0], [3.0, 2.0], [1.0, 4.5]])
    found = angular_grids(
        np.array([[1.0, 1.0], [3.0, 2.0], [0.2, 0.1]]), np.array([0.0, np.pi / 2, 0.0]), crowd,
        np.array([6, 8, 5, 7, 6]), np.array([5, 7, 8]), np.array([[2, 5], [2, 5], [0, 2]]), 4, 5.0,
    )  # fmt: skip
    near, far, own = np.sqrt(5.0), np.sqrt(4 + 2.5**2), 0.1
    np.testing.assert_allclose(found, [[near, 3.5, 5, 5], [far, near, 5, 5], [5, 5, own, 5]], rtol=1e-6)


FEATURES = LstmFeatures(4, 0.5, 4, 5.0)


def seen_from(position, heading_rad, velocity, others):
    """One tracked person, number 3, among others."""
    none, one = np.zeros(0), np.zeros(1)
    who = Pedestrians(np.array([3]), np.array([position]), np.array([heading_rad]), np.array([velocity]))
    past = Past(none, np.zeros((0, 2)), np.zeros((1, 2), int), one, *np.zeros((2, 1, 2)), np.zeros((1, 3)))
    place = np.array([position, *others])
    around = Neighbours(np.arange(3, 3 + len(place)), place, 0 * place, np.array([[0, len(place)]]))
    return Surroundings(who, past, one, around, MAP)


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_inputs_are_agent_frame_velocity_crop_and_distances(dt_s):
    """Velocity (1, 0.5) seen along (0.6, 0.8): 1.0 forward, -0.5 left. One neighbour, 2 m to the left."""
    found = FEATURES.compute(seen_from((0.0, 3.0), TURNED, (1.0, 0.5), [(-1.6, 4.2), (9.0, 3.0)]), dt_s)
    assert list(found) == ["state", "occupancy", "angular_grid"]
    np.testing.assert_allclose(found["state"], [[1.0, -0.5]], atol=1e-6)
    assert found["state"].dtype == np.float32
    expected, _ = crops([[0.0, 3.0]], [TURNED])
    alone = FEATURES.obstacle_inputs(MAP, np.array([[0.0, 3.0]]), np.array([TURNED]))
    assert alone.keys() == {"occupancy"}  # of a network without neighbours
    for inputs in (found, alone):
        np.testing.assert_array_equal(inputs["occupancy"], expected)
    left = found["angular_grid"][0]
    assert sorted(left.tolist()) == pytest.approx([2.0, 5.0, 5.0, 5.0])
    assert left[:2].min() == pytest.approx(2.0)  # at 90 degrees, the edge of cones 0 and 1


def test_channels_are_velocity_and_one_minus_share_of_the_range():
    """1 - r / 5 m: 0 m is 1, 1.25 m is 0.75, 4 m is 0.2, and an empty cone is 0."""
    stored = {"state": np.array([[0.5, -0.25]], np.float32), "occupancy": np.array([[0b1001, 0]], np.uint8)}
    stored["angular_grid"] = np.array([[0.0, 1.25, 4.0, 5.0]], np.float32)
    found = FEATURES.channels(stored)
    assert found.keys() == {"state", "angular"}
    np.testing.assert_array_equal(found["state"], [[0.5, -0.25]])
    np.testing.assert_allclose(found["angular"], [[1.0, 0.75, 0.2, 0.0]], atol=1e-6)
    assert found["angular"].dtype == np.float32
    graph = FEATURES.graph_inputs(stored)
    assert graph.keys() == {"state", "angular", "crop"}
    np.testing.assert_allclose(graph["angular"], found["angular"])
    assert graph["crop"].dtype == np.float32
    np.testing.assert_array_equal(graph["crop"], [[[1, 0, 0, 1], [0] * 4, [0] * 4, [0] * 4]])


def test_sizes_are_the_papers_by_default():
    """60 x 60 cells of 0.1 m, 72 cones, 6 m; Pfeiffer et al. 2018, IV."""
    paper = LstmFeatures()
    assert paper == LstmFeatures(grid_cells=60, grid_resolution_m=0.1, angular_cells=72, max_range_m=6.0)
    assert paper.shapes() == {"state": (2,), "crop": (60, 60), "angular": (72,)}
    columns = {name: np.zeros((2, *column.shape), column.dtype) for name, column in paper.columns().items()}
    assert {name: (rows.dtype.name, rows.shape) for name, rows in columns.items()} == {
        "state": ("float32", (2, 2)),
        "occupancy": ("uint8", (2, 450)),
        "angular_grid": ("float32", (2, 72)),
    }
    assert paper.past_s(0.4) == 0.0
