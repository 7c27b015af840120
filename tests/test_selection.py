"""People who choose their modes together: who regards whom, and what does not matter."""

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.forecasting.selection import NEAR_M, REACH_M, ROUNDS, choose_modes
from pedpred.geometry import rotate
from pedpred.metrics.paths import too_close
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


def test_most_likely_paths_collide_less():
    rng = np.random.default_rng(0)
    parts = [crowd(rng) for _ in range(40)]
    shares = [
        np.mean([too_close(p.most_likely, np.zeros(12), 0.2).mean() for p in group])
        for group in ([p for p, _ in parts], [choose_modes(p, here) for p, here in parts])
    ]
    assert shares[1] < 0.5 * shares[0]


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


@settings(max_examples=50, deadline=None)
@given(seed=SEEDS)
def test_nobody_beyond_the_reach_of_all_rounds_matters(seed):
    """Not even through a crowd that stands in between."""
    rng = np.random.default_rng(seed)
    before, here = crowd(rng, 40, 50.0)
    changed, moved = crowd(rng, 40, 50.0)
    far = np.linalg.norm(here - here[0], axis=-1) > ROUNDS * REACH_M
    far &= np.linalg.norm(moved - here[0], axis=-1) > ROUNDS * REACH_M
    path = np.where(far[:, None, None, None], changed.path, before.path)
    other = dataclasses.replace(before, path=path)
    place = np.where(far[:, None], moved, here)
    np.testing.assert_allclose(
        choose_modes(other, place).weight[0], choose_modes(before, here).weight[0], atol=1e-12
    )


def test_equal_modes_stay_equally_likely():
    """Mirror images of a path, both as near to somebody who stands ahead."""
    ahead, side = np.arange(1, STEPS + 1)[:, None] * [0.4, 0.0], np.array([0.0, 0.1])
    path = np.stack([ahead + side, ahead - side])[None].repeat(2, axis=0)
    path[1] = [4.0, 0.0]
    predictions = Predictions(path[:, 0], path, np.full((2, 2), 0.5), DT_S)
    after = choose_modes(predictions, np.array([[0.0, 0.0], [4.0, 0.0]]))
    np.testing.assert_array_equal(after.weight, 0.5)
    np.testing.assert_array_equal(after.path, predictions.path)


def test_what_does_not_belong_together_is_refused():
    before, here = crowd(np.random.default_rng(3))
    with refused("position"):
        choose_modes(before, here[:5])
    with refused("frame"):
        choose_modes(dataclasses.replace(before, frame="agent"), here)
    assert NEAR_M < REACH_M
