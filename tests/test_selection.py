"""People who choose their modes together: who regards whom, and what does not matter."""

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.forecasting.selection import choose_modes
from pedpred.geometry import rotate
from pedpred.scenes import Predictions
from tests.refused import refused

STEPS, MODES, DT_S = 10, 4, 0.3
SEEDS = st.integers(0, 2**32 - 1)


def crowd(rng, people=12, side_m=6.0):
    """Random straight modes of people in a square, and where they are."""
    here = rng.uniform(0, side_m, (people, 2))
    velocity = rng.normal(0, 1.0, (people, 1, 1, 2)) + rng.normal(0, 0.5, (people, MODES, 1, 2))
    path = here[:, None, None] + velocity * DT_S * np.arange(1, STEPS + 1)[:, None]
    weight = -np.sort(-rng.dirichlet(np.ones(MODES), people), axis=1)
    spread = rng.uniform(0.1, 1.0, (people, MODES, STEPS))[..., None, None] * np.eye(2)
    return Predictions(path[:, 0], path, weight, DT_S, spread), here


@settings(max_examples=50, deadline=None)
@given(seed=SEEDS, turn=st.floats(-4, 4), side=st.sampled_from([-1.0, 1.0]))
def test_order_frame_mirror_and_rounding_play_no_part(seed, turn, side):
    rng = np.random.default_rng(seed)
    before, here = crowd(rng)

    def moved(points):
        return rotate(points * [1.0, side], np.full(points.shape[:-1], turn)) + np.array([3.0, -40.0])

    path = moved(before.path + rng.normal(0, 1e-12, before.path.shape))
    there, order = dataclasses.replace(before, point=moved(before.point), path=path), rng.permutation(12)
    one, other = choose_modes(before, here), choose_modes(there.select(order), moved(here)[order])
    np.testing.assert_allclose(other.weight, one.weight[order], atol=1e-9)
    np.testing.assert_allclose(other.most_likely, moved(one.most_likely)[order], atol=1e-9)


def test_people_without_a_position_are_refused():
    before, here = crowd(np.random.default_rng(3))
    with refused("position"):
        choose_modes(before, here[:5])
