"""Modes that are merged, and what network outputs mean as predictions, from the equations."""

import numpy as np
import pytest

from pedpred.forecasting.reduction import merge_modes
from pedpred.forecasting.tensors import TENSORS, predictions_of, sound_rows
from pedpred.scenes import Predictions
from tests.forecasts import drawn_predictions


def of_one(path, weight, covariance):
    """Predictions of one person with such modes."""
    path, covariance = np.array([path], np.float64), np.array([covariance], np.float64)
    return Predictions(path[:, 0], path, np.array([weight]), 0.4, covariance)


def merged_moments(path, weight, covariance):
    """Of several modes [K, P, ...] together: weight, mean, and the covariance within and between them."""
    total = weight.sum()
    mean = np.einsum("k,kpa->pa", weight, path) / total
    between = np.einsum("k,kpa,kpb->pab", weight, path - mean, path - mean)
    return mean, total, (np.einsum("k,kpab->pab", weight, covariance) + between) / total


def cost(path, weight, covariance):
    """((w_i + w_j) ln det C - w_i ln det C_i - w_j ln det C_j) / 2, mean of steps. Runnalls 2007, eq. 21."""
    _, total, both = merged_moments(path, weight, covariance)
    sizes = np.log(np.linalg.det(covariance)).mean(axis=1)
    return (total * np.log(np.linalg.det(both)).mean() - weight @ sizes) / 2


def reduced(path, weight, covariance, most):
    """The pair of the least cost becomes one mode, again and again; the likeliest first."""
    while len(weight) > most:
        pairs = [(i, j) for i in range(len(weight)) for j in range(i)]
        one = min(pairs, key=lambda pair: cost(*(v[list(pair)] for v in (path, weight, covariance))))
        both = merged_moments(*(values[list(one)] for values in (path, weight, covariance)))
        path, weight, covariance = (
            np.concatenate([np.delete(old, one, axis=0), [new]])
            for old, new in zip((path, weight, covariance), both, strict=True)
        )
    order = np.argsort(-weight)
    return path[order], weight[order], covariance[order]


@pytest.mark.parametrize(("steps", "most"), [(1, 3), (3, 2), (8, 1), (9, 4), (17, 6), (2, None)])
def test_the_pair_of_the_least_cost_is_merged_first(steps, most):
    """Of each person alone; costs are means over the steps. Six modes are left if no number is given."""
    rng = np.random.default_rng(50 + steps)
    given = drawn_predictions(rng, 6, 7, steps)
    after = merge_modes(given) if most is None else merge_modes(given, most)
    assert (after.dt_s, after.frame) == (0.3, "world")
    for row in range(6):
        expected = reduced(given.path[row], given.weight[row], given.covariance[row], most or 6)
        for one, other in zip((after.path, after.weight, after.covariance), expected, strict=True):
            np.testing.assert_allclose(one[row], other, rtol=1e-9, atol=1e-12)


def apart_for(cost_per_weight, share):
    """How far apart two modes of covariance 1 are that cost so much: w / 2 ln(1 + share (1 - share) d^2)."""
    return np.sqrt(np.expm1(2 * cost_per_weight) / (share * (1 - share)))


def two_pairs(costs, weight, most, steps=1):
    """Two pairs of modes with such costs of merging, far from each other; modes after reduction."""
    far = [0.0, apart_for(costs[0] / sum(weight[:2]), weight[0] / sum(weight[:2]))]
    far += [100.0, 100.0 + apart_for(costs[1] / sum(weight[2:]), weight[2] / sum(weight[2:]))]
    order = np.argsort(-np.array(weight), kind="stable")
    path = np.array([[[0.0, x]] * steps for x in far])[order]
    after = merge_modes(of_one(path, np.array(weight)[order], np.tile(np.eye(2), (4, steps, 1, 1))), most)
    return after.weight[0].tolist(), after.path[0, :, 0, 1].tolist()


@pytest.mark.parametrize("steps", [1, 8, 9, 20])
def test_equal_costs_are_merged_at_once(steps):
    """Costs that differ by less than 1 in 1000; the most likely mode is then given twice, with half of it.

    At 1.05 in 1000 only the first pair is merged. Costs do not depend on the number of equal steps.
    """
    weight = [0.2, 0.25, 0.3, 0.25]
    for costs, most, expected in (
        ((0.1, 0.10009), 3, [0.45, 0.275, 0.275]),
        ((0.10009, 0.1), 3, [0.45, 0.275, 0.275]),
        ((0.1, 0.100105), 3, [0.45, 0.3, 0.25]),
        ((0.100105, 0.1), 3, [0.55, 0.25, 0.2]),
        ((0.1, 0.10009), 2, [0.55, 0.45]),
    ):
        assert two_pairs(costs, weight, most, steps)[0] == pytest.approx(expected)


def test_copies_are_the_likeliest_mode_at_the_same_place():
    """All four become two, 0.55 and 0.45; the first one and then the second are halved."""
    weight, x = two_pairs((0.1, 0.10009), [0.2, 0.25, 0.3, 0.25], 3)
    assert x[0] == pytest.approx(apart_for(0.1 / 0.45, 0.2 / 0.45) * 0.25 / 0.45)
    assert x[1] == x[2] > 99.0
    assert weight[1] == weight[2]


def test_copies_have_the_covariances_of_all_steps():
    """Three modes at the corners of a triangle become one, which is given twice."""
    corner = np.array([[1.0, 0.0], [-0.5, 0.75**0.5], [-0.5, -(0.75**0.5)]])
    path = np.stack([corner, 1.5 * corner], axis=1)
    covariance = np.broadcast_to(np.array([np.eye(2), 2 * np.eye(2)]), (3, 2, 2, 2))
    after = merge_modes(of_one(path, [1 / 3, 1 / 3, 1 / 3], covariance), 2)
    np.testing.assert_allclose(after.weight, [[0.5, 0.5]])
    np.testing.assert_allclose(after.path, 0.0, atol=1e-12)
    expected = np.tile([1.5 * np.eye(2), (2 + 1.125) * np.eye(2)], (2, 1, 1, 1))
    np.testing.assert_allclose(after.covariance[0], expected, atol=1e-12)


def test_modes_that_are_the_same_are_merged_at_once():
    """A cost of 1e-6 per weight counts as none, besides that of copies, which is 0."""
    weight = [0.2, 0.25, 0.3, 0.25]
    assert two_pairs((0.0, 0.95e-6 * 0.55), weight, 3)[0] == pytest.approx([0.45, 0.275, 0.275])
    assert two_pairs((0.0, 1.05e-6 * 0.55), weight, 3)[0] == pytest.approx([0.45, 0.3, 0.25])


def test_covariances_of_certain_people_do_not_underflow():
    """Standard deviations of 1e-9 m at ten steps: the product of all determinants is 1e-360."""
    path = np.zeros((3, 10, 2))
    path[:, :, 0] = np.array([0.0, 3e-9, 1e-9])[:, None]
    after = merge_modes(of_one(path, [0.5, 0.3, 0.2], np.full((3, 10, 1, 1), 1e-18) * np.eye(2)), 2)
    np.testing.assert_allclose(after.weight, [[0.7, 0.3]])
    np.testing.assert_allclose(after.path[0, :, 0, 0], [0.2 / 0.7 * 1e-9, 3e-9])


def test_as_many_modes_as_may_be_stay():
    rng = np.random.default_rng(1)
    weight = [0.3, 0.2, 0.2, 0.1, 0.1, 0.1]
    given = of_one(rng.normal(size=(6, 1, 2)), weight, np.tile(np.eye(2), (6, 1, 1, 1)))
    assert merge_modes(given) is given


VELOCITIES = np.array([[[1.0, 0.5], [0.6, -0.5], [0.2, 1.5]], [[0.0, 2.0], [-1.0, 1.0], [0.5, 0.25]]])
"""Of two people at three steps, m/s."""


def test_the_point_forecast_is_the_path_of_the_velocities():
    """x_p = 0.4 s (v_1 + ... + v_p); without modes it is the only one."""
    found = predictions_of({"velocities": VELOCITIES.astype(np.float32)}, 0.4)
    expected = np.array([[[0.4, 0.2], [0.64, 0.0], [0.72, 0.6]], [[0.0, 0.8], [-0.4, 1.2], [-0.2, 1.3]]])
    np.testing.assert_allclose(found.point, expected, rtol=1e-6)
    np.testing.assert_array_equal(found.path[:, 0], found.point)
    np.testing.assert_array_equal(found.weight, [[1.0], [1.0]])
    assert (found.dt_s, found.frame, found.covariance) == (0.4, "agent", None)
    covariance = np.arange(1.0, 7.0).reshape(2, 1, 3)[..., None, None] * np.eye(2)
    found = predictions_of({"velocities": VELOCITIES, "covariance": covariance}, 0.4)
    np.testing.assert_array_equal(found.covariance, covariance)
    assert found.frame == "agent"


def test_modes_are_sorted_by_weights_that_sum_to_1():
    """0.4, 2, 1.6 of 4; and 1, 1, 0, which becomes 1e-5: weights are rounded to four digits first."""
    path = np.arange(36.0).reshape(2, 3, 3, 2)
    covariance = np.arange(1.0, 19.0).reshape(2, 3, 3)[..., None, None] * np.eye(2)
    tensors = {"velocities": VELOCITIES, "path": path, "covariance": covariance}
    found = predictions_of(tensors | {"weight": np.array([[0.4, 2.0, 1.6], [1.0, 1.00002, 0.0]])}, 0.3)
    order = [[1, 2, 0], [0, 1, 2]]
    least = 1e-5 / (1 + 1e-5)
    expected = [[0.5, 0.4, 0.1], [0.5 * (1 - least), 0.5 * (1 - least), least]]
    np.testing.assert_allclose(found.weight, expected, rtol=1e-12)
    np.testing.assert_array_equal(found.path, path[np.arange(2)[:, None], order])
    np.testing.assert_array_equal(found.covariance, covariance[np.arange(2)[:, None], order])
    np.testing.assert_allclose(found.point, np.cumsum(VELOCITIES * 0.3, axis=1))
    assert (found.dt_s, found.frame) == (0.3, "agent")


def test_weights_are_rounded_to_four_digits():
    """0.50004 and 0.49996 are equal, so that the first mode stays first; 0.49994 and 0.50006 are not."""
    path = np.arange(4.0).reshape(1, 2, 1, 2)
    for weight, first in (([0.49996, 0.50004], 0.0), ([0.49994, 0.50006], 2.0)):
        given = {"velocities": VELOCITIES[:1, :1], "path": path, "weight": np.array([weight])}
        found = predictions_of(given, 0.3)
        assert found.path[0, 0, 0, 0] == first
        assert found.covariance is None
        assert found.weight[0, 0] == pytest.approx(0.5 if first == 0.0 else 0.5001)


def test_more_than_six_modes_of_a_network_are_merged():
    path = np.zeros((1, 7, 1, 2))
    path[0, :, 0, 0] = [0.0, 5.0, 10.0, 20.0, 30.0, 30.5, 40.0]
    weight = np.array([[0.1, 0.1, 0.1, 0.2, 0.1, 0.3, 0.1]])
    covariance = np.tile(np.eye(2), (1, 7, 1, 1, 1))
    given = {"velocities": VELOCITIES[:1, :1], "path": path, "weight": weight, "covariance": covariance}
    found = predictions_of(given, 0.3)
    np.testing.assert_allclose(found.weight, [[0.4, 0.2, 0.1, 0.1, 0.1, 0.1]])
    np.testing.assert_allclose(found.path[0, :, 0, 0], [30.375, 20.0, 0.0, 5.0, 10.0, 40.0])
    assert tuple(given) == TENSORS


def test_rows_are_forecasts_if_all_numbers_are_finite():
    tensors = {"velocities": np.ones((4, 2, 2)), "path": np.ones((4, 1, 2, 2))}
    tensors["velocities"][1, 1, 0] = np.nan
    tensors["path"][3, 0, 0, 1] = np.inf
    np.testing.assert_array_equal(sound_rows(tensors), [True, False, True, False])
    assert sound_rows({"velocities": np.ones((0, 2, 2))}).shape == (0,)


def test_rows_are_forecasts_if_they_have_weights():
    weight = np.array([[0.5, 0.5], [0.0, 0.0], [1.5, -0.5], [0.0, 0.2], [0.3, 0.0]])
    found = sound_rows({"velocities": np.ones((5, 1, 2)), "weight": weight})
    np.testing.assert_array_equal(found, [True, False, False, True, True])


def test_rows_are_forecasts_if_covariances_are_positive_definite():
    """xx > 0 and xx yy > xy^2, at each mode and step."""
    good, less = [[2.0, 0.3], [0.3, 0.5]], [[0.5, 0.3], [0.3, 2.0]]
    bad = [[[0.0, 0.0], [0.0, 1.0]], [[-1.0, 0.5], [0.5, -1.0]], [[1.0, 2.0], [2.0, 4.0]]]
    bad += [[[0.5, 0.9], [0.9, 1.0]], [[2.0, 0.0], [0.0, 0.0]]]
    rows = np.array([[[good, less]], *([[good, one]] for one in bad), [[bad[0], good]], [[less, good]]])
    found = sound_rows({"velocities": np.ones((8, 2, 2)), "covariance": rows})
    np.testing.assert_array_equal(found, [True] + [False] * 6 + [True])


def test_rows_are_forecasts_if_all_their_tensors_are_sound():
    """Of the first three, one tensor each is not."""
    tensors = {"velocities": np.ones((4, 1, 2)), "weight": np.ones((4, 1))}
    tensors["covariance"] = np.tile(np.eye(2), (4, 1, 1, 1, 1))
    tensors["velocities"][0], tensors["weight"][1], tensors["covariance"][2] = np.nan, -1.0, 0.0
    np.testing.assert_array_equal(sound_rows(tensors), [False, False, False, True])
