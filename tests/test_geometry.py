"""Laws of the coordinate frames."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pedpred.geometry import Homography, rotate
from tests.refused import refused

metres = st.floats(-1e3, 1e3)
points = arrays(np.float64, st.tuples(st.integers(0, 5), st.just(2)), elements=metres)
point = arrays(np.float64, 2, elements=metres)
angles = st.floats(-20.0, 20.0)


@st.composite
def homographies(draw):
    """Cameras that see the plane from above, some turned, stretched or inclined."""
    turn = draw(st.floats(-np.pi, np.pi))
    scale = draw(arrays(np.float64, 2, elements=st.floats(0.01, 1.0)))
    tilt = draw(arrays(np.float64, 2, elements=st.floats(0.0, 1e-3)))
    matrix = np.eye(3)
    matrix[:2, :2] = rotate(np.diag(scale), turn).T
    matrix[:2, 2] = draw(point)
    matrix[2, :2] = tilt
    return Homography(matrix, first_pixel=draw(st.sampled_from([0, 1])))


@given(homographies(), arrays(np.float64, (4, 2), elements=st.floats(0.0, 1e3)))
def test_homography_there_and_back(homography, pixels_rc):
    back = homography.to_image(homography.to_world(pixels_rc))
    np.testing.assert_allclose(back, pixels_rc, atol=1e-4)


def test_homography_refuses_points_that_are_no_pairs():
    with refused("pixels_rc"):
        Homography(np.eye(3)).to_world(np.zeros((4, 3)))


def test_pixels_are_counted_from_the_first_one():
    matrix = np.diag([2.0, 3.0, 1.0])
    assert Homography(matrix).to_world(np.array([5.0, 7.0])).tolist() == [10.0, 21.0]
    assert Homography(matrix, first_pixel=1).to_world(np.array([5.0, 7.0])).tolist() == [12.0, 24.0]


@given(points, angles)
def test_rotation_there_and_back_keeps_lengths(vectors, angle_rad):
    turned = rotate(vectors, angle_rad)
    np.testing.assert_allclose(rotate(turned, -angle_rad), vectors, atol=1e-9)
    np.testing.assert_allclose(np.hypot(*turned.T), np.hypot(*vectors.T), atol=1e-9)
