"""The cheapest pairs that a robot computes are those of SciPy, which it does not have."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

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
