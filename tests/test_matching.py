"""The cheapest pairs and rotations that a robot computes are those of SciPy, which it does not have."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation, Slerp

from pedpred.ros.rotations import angle_rad, between, composed, inverse, normalised, rotated
from pedpred.tracking.matching import cheapest_pairs, distances_m

SIDES = st.tuples(st.integers(0, 8), st.integers(0, 8))
COSTS = SIDES.flatmap(
    lambda sides: st.one_of(
        arrays(np.float64, sides, elements=st.floats(-1e6, 1e6)),
        arrays(np.float64, sides, elements=st.integers(0, 3).map(float)),  # several pairings cost the same
    )
)
SEEDS = st.integers(0, 2**32)


@given(COSTS)
def test_the_cheapest_pairs_are_those_of_scipy(costs):
    for own, theirs in zip(cheapest_pairs(costs), linear_sum_assignment(costs), strict=True):
        np.testing.assert_array_equal(own, theirs)


@given(SEEDS)
def test_distances_are_those_of_scipy(seed):
    rng = np.random.default_rng(seed)
    first, second = (rng.normal(0.0, 10.0, (count, 2)) for count in rng.integers(0, 9, 2))
    np.testing.assert_array_equal(distances_m(first, second), cdist(first, second))


def turns(rng, count):
    """Some rotations; half of them are nearly the one before."""
    own = rng.normal(size=(count, 4))
    own[1::2] = own[::2] + rng.choice([0.0, 1e-9, 1e-4]) * rng.normal(size=(count // 2, 4))
    return normalised(own)


@given(SEEDS)
def test_rotations_are_those_of_scipy(seed):
    rng = np.random.default_rng(seed)
    first, second, places = turns(rng, 6), turns(rng, 6), rng.normal(0.0, 10.0, (6, 3))
    theirs, others = Rotation.from_quat(first), Rotation.from_quat(second)
    np.testing.assert_allclose(rotated(first, places), theirs.apply(places), atol=1e-12)
    np.testing.assert_allclose(rotated(inverse(first), places), theirs.inv().apply(places), atol=1e-12)
    np.testing.assert_allclose(composed(second, first), (others * theirs).as_quat(), atol=1e-14)
    np.testing.assert_allclose(angle_rad(first), theirs.magnitude(), atol=1e-12)


@given(SEEDS)
def test_between_two_rotations_is_the_way_of_scipy(seed):
    rng = np.random.default_rng(seed)
    ends, part = turns(rng, 6), rng.choice([0.0, 1.0, rng.uniform()], 5)
    own = between(ends[:-1], ends[1:], part)
    theirs = Slerp(np.arange(6.0), Rotation.from_quat(ends))(np.arange(5) + part)
    assert (Rotation.from_quat(own) * theirs.inv()).magnitude().max() < 1e-9
