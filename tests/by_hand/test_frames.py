"""Rotations, agent frames and cameras beside numbers by hand."""

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.geometry import Homography, placed, rotate, rotated_covariance

ANGLES = np.array([np.arctan2(0.8, 0.6), np.arctan2(-5.0, 12.0), 0.75 * np.pi])
COSINES, SINES = np.array([0.6, 12 / 13, -np.sqrt(0.5)]), np.array([0.8, -5 / 13, np.sqrt(0.5)])


def test_vectors_turn_counter_clockwise_each_by_its_angle():
    """(c x - s y, s x + c y)."""
    vectors = np.array([[[2.0, 1.0], [-3.0, 0.5]], [[0.4, -1.0], [6.0, 2.0]], [[1.0, 5.0], [-2.0, -7.0]]])
    c, s, x, y = COSINES[:, None], SINES[:, None], vectors[..., 0], vectors[..., 1]
    found = rotate(vectors, ANGLES[:, None])
    np.testing.assert_allclose(found[0, 0], [0.4, 2.2])
    np.testing.assert_allclose(found, np.stack([c * x - s * y, s * x + c * y], axis=-1))
    np.testing.assert_allclose(rotate(vectors[0], ANGLES[:2]), [[0.4, 2.2], [-33.5 / 13, 21 / 13]])
    np.testing.assert_allclose(rotate([2.0, 1.0], ANGLES[0]), [0.4, 2.2])


def test_points_of_agents_are_placed_at_their_origins():
    points = np.arange(24.0).reshape(3, 2, 2, 2) - 7.0
    origin = np.array([[1.0, -2.0], [30.0, 0.5], [-4.0, 9.0]])
    c, s = COSINES[:, None, None], SINES[:, None, None]
    x, y = points[..., 0], points[..., 1]
    expected = np.stack([c * x - s * y, s * x + c * y], axis=-1) + origin[:, None, None]
    np.testing.assert_allclose(placed(points, origin, ANGLES), expected)
    np.testing.assert_allclose(placed(points[:, 0, 0], origin, ANGLES), expected[:, 0, 0])
    assert placed(points[:0], origin[:0], ANGLES[:0]).shape == (0, 2, 2, 2)


def test_covariances_turn_on_both_sides():
    """R S R^T."""
    own = np.array([[[[0.9, 0.2], [0.2, 0.4]], [[2.0, -0.5], [-0.5, 1.0]]]])
    own = own * np.arange(1, 4)[:, None, None, None]
    turn = np.moveaxis(np.array([[COSINES, -SINES], [SINES, COSINES]]), -1, 0)[:, None]
    expected = turn @ own @ np.swapaxes(turn, -1, -2)
    np.testing.assert_allclose(rotated_covariance(own, ANGLES), expected)
    np.testing.assert_allclose(rotated_covariance(own[:, 1], ANGLES), expected[:, 1])
    np.testing.assert_allclose(expected[0, 0, 0, 0], 0.36 * 0.9 - 2 * 0.48 * 0.2 + 0.64 * 0.4)


def test_a_camera_divides_by_the_third_coordinate():
    """(10, 20) -> (31, 59, 2) -> (15.5, 29.5); (4, 0) -> (9, -1.6, 1.54); the horizon is infinitely far."""
    matrix = [[2.0, 0.5, 1.0], [0.1, 3.0, -2.0], [0.01, 0.02, 1.5]]
    points = [[15.5, 29.5], [9.0 / 1.54, -1.6 / 1.54]]
    for first, pixels in ((0, [[10.0, 20.0], [4.0, 0.0]]), (1, [[9.0, 19.0], [3.0, -1.0]])):
        camera = Homography(np.array(matrix), first)
        np.testing.assert_allclose(camera.to_world(np.array(pixels)), points)
        np.testing.assert_allclose(camera.to_image(np.array(points)), pixels, atol=1e-10)
    assert np.isinf(Homography(np.array(matrix)).to_world(np.array([-150.0, 0.0]))).all()
    assert Homography(np.array(matrix)).first_pixel == 0


def test_a_camera_is_an_invertible_matrix_of_numbers():
    """The last two have conditions 0.95e-12 and 1.05e-12."""
    for matrix in (np.eye(4), np.diag([1.0, np.inf, 1.0]), np.zeros((3, 3)), np.diag([1.0, 1.0, 0.95e-12])):
        with pytest.raises(ValueRuleError):
            Homography(matrix)
    assert Homography(np.diag([1, 100, 1000])).matrix.dtype == np.float64
    Homography(np.diag([1.0, 1.0, 1.05e-12]))
    for points in (np.array(1.0), np.zeros((2, 3))):
        with pytest.raises(ValueRuleError):
            Homography(np.eye(3)).to_image(points)
