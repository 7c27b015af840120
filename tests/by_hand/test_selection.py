"""People who choose modes together: who meets whom, how strongly, and the choice, from the equations."""

import numpy as np
import pytest

from pedpred.forecasting.selection import _choose, _conflicts, choose_modes
from pedpred.scenes import Predictions

MEET = np.array([[[[3.0, 1.0]], [[3.0, 1.0]]]])
"""Two modes of somebody who is at (3, 1) after the only step. [1, 2, 1, 2]."""


def listed(path, position):
    """Closeness of each conflict by the numbers of both people and modes."""
    first, second, closeness = _conflicts(np.array(path), np.array(position))
    modes = len(path[0])
    both = zip(first.tolist(), second.tolist(), closeness.tolist(), strict=True)
    return {(*divmod(one, modes), *divmod(other, modes)): close for one, other, close in both}


def test_closeness_is_of_the_least_distance_at_equal_steps():
    """1 - d / 0.3 m. Distances of the steps: modes 0 and 0 0.5, 0.13, 0.25; 0 and 1 0.3, 0.4, 0.9.

    Mode 1 of the first person is 0.15 m from the second person's mode 0 at the last step. It crosses the
    place where mode 1 is a step earlier, which is no conflict.
    """
    first = [[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[0.0, 0.3], [2.0, 0.9], [2.09, 0.37]]]
    second = [[[0.3, 0.4], [1.05, 0.12], [2.0, 0.25]], [[0.0, -0.3], [1.0, -0.4], [2.0, 0.9]]]
    found = listed([first, second], [[0.0, 0.0], [3.0, 4.0]])
    assert found == pytest.approx({(0, 0, 1, 0): 1 - 0.13 / 0.3, (0, 1, 1, 0): 1 - 0.15 / 0.3})


@pytest.mark.parametrize(("axis", "sign"), [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)])
def test_paths_meet_within_0_3_m_on_either_side(axis, sign):
    for away_m, expected in ((0.29, 0.01 / 0.3), (0.31, None)):
        other = MEET.copy()
        other[0, 1, 0, axis] += sign * away_m
        other[0, 0] += 50.0
        found = listed(np.concatenate([MEET, other]), [[3.0, 1.0], [3.0, 1.0]])
        pairs = {(0, 0, 1, 1): expected, (0, 1, 1, 1): expected} if expected else {}
        assert found == pytest.approx(pairs)


@pytest.mark.parametrize(
    ("x", "y", "share"),
    [
        *((3.0, 4.0, 1.0), (3.6, 4.8, 0.5), (-5.0, 1.0, (7.0 - 26**0.5) / 2)),
        *((7.0, 0.0, 0.0), (4.2, 5.6, 0.0), (6.0, 6.0, 0.0)),
    ],
)
def test_people_regard_each_other_from_7_m_on(x, y, share):
    """(7 m - away) / 2 m, at most 1. The paths are 0.1 m apart."""
    path = np.concatenate([MEET, MEET + np.array([0.06, 0.08])])
    found = listed(path, [[2.0, -1.0], [2.0 + x, -1.0 + y]])
    pairs = [(0, k, 1, m) for k in range(2) for m in range(2)] if share else []
    assert found == pytest.approx(dict.fromkeys(pairs, share * (1 - 0.1 / 0.3)))


def test_who_is_too_far_away_does_not_hide_those_after():
    """The second person is far from the first; the third meets both."""
    path = np.concatenate([MEET, MEET, MEET])
    found = listed(path, [[0.0, 0.0], [9.0, 0.0], [4.5, 0.0]])
    assert sorted({(one, other) for one, _, other, _ in found}) == [(0, 2), (1, 2)]


def test_all_conflicts_are_found_where_there_are_many():
    """20 modes of two people that all meet have 400, more than the first room of 8 * 40."""
    path = np.repeat(MEET[:, :1], 20, axis=1)
    found = listed(np.concatenate([path, path]), [[0.0, 0.0], [0.0, 0.0]])
    assert len(found) == 400
    assert set(found.values()) == {1.0}


@pytest.mark.parametrize(
    ("people", "away_m", "conflicts", "closeness"),
    [
        (257, 6.0, 256 * 514, {1.0, 0.5}),  # as many as there may be
        (258, 0.0, 0, set()),
        (258, 3.0, 2 * 4 * 129 * 64, {1.75 / 2}),
        (258, 1.0, 2 * 4 * 129 * 64, {1.75 / 8}),
    ],
)
def test_of_too_many_conflicts_those_nearer_by_count(people, away_m, conflicts, closeness):
    """At most 256 of each mode: else people regard others within 7 / 4 m, or 7 / 16 m.

    Half of the people stand apart from the others, and all paths meet: N (N - 1) / 2 pairs of people have
    four conflicts each.
    """
    position = np.zeros((people, 2))
    position[::2, 1] = away_m
    first, second, close = _conflicts(np.repeat(MEET, people, axis=0), position)
    assert len(first) == len(second) == conflicts
    assert set(close.tolist()) == closeness


def scores(path, weight, position):
    """ln w_i(k) - 6 L_i(k) after three rounds in which all L go half way to sum_jl q_j(l) closeness. [N, K].

    q_i(k) ~ exp(4 (ln w_i(k) - 6 L_i(k)))
    """
    apart_m = np.linalg.norm(path[:, :, None, None] - path, axis=-1).min(axis=-1)
    away_m = np.linalg.norm(position[:, None] - position, axis=-1)
    regard = np.clip((7.0 - away_m) / 2.0, 0.0, 1.0) - np.eye(len(path))
    close = np.maximum(0.0, 1.0 - apart_m / 0.3) * np.maximum(regard, 0.0)[:, None, :, None]
    alone, load = np.log(weight), np.zeros(weight.shape)
    for _ in range(3):
        likely = np.exp(4.0 * (alone - 6.0 * load))
        likely /= likely.sum(axis=1, keepdims=True)
        load = 0.5 * load + 0.5 * np.einsum("ikjl,jl->ik", close, likely)
    return alone - 6.0 * load


def shared(weight, chosen):
    """The weights of a person after a choice: modes that are as likely or more share theirs evenly."""
    return np.where(weight >= weight[chosen], weight[weight >= weight[chosen]].mean(), weight)


def test_choices_of_many_crowds_are_those_of_the_equations():
    """Four people with three unequal modes of unequal steps, whose paths meet; some are more than 5 m apart.

    The same scores in another place of the list of people would give other choices: no round is in turn.
    """
    rng, chosen = np.random.default_rng(11), []
    for k in range(300):
        origin = np.array([[40.0, -7.0], [-7.0, 40.0]][k % 2])
        position = origin + rng.uniform(-3.0, 3.0, (4, 2))
        path = origin + np.cumsum(rng.normal(0.0, [0.3, 0.2], (4, 3, 4, 2)), axis=2)
        weight = -np.sort(-rng.dirichlet([2.0, 2.0, 2.0], 4), axis=1)
        after = choose_modes(Predictions(path[:, 0], path, weight, 0.4), position)
        value = scores(path, weight, position)
        best = value.argmax(axis=1)
        chosen.append(best)
        order = [[k, *(m for m in range(3) if m != k)] for k in best]
        np.testing.assert_array_equal(after.path, path[np.arange(4)[:, None], order])
        np.testing.assert_allclose(after.weight, [shared(w, k) for w, k in zip(weight, best, strict=True)])
    assert (np.bincount(np.ravel(chosen)) > 100).all()


def met(nearest_m):
    """Weights of somebody of whom one mode is certain, where six people stand in its way.

    The other mode, of weight 0, is free. Five people stand on the path, at steps of their own; the sixth
    stands beside it.
    """
    ahead = np.stack([0.7 * np.arange(1, 7), np.zeros(6)], axis=-1)
    path = np.stack([ahead, ahead + np.array([0.0, 9.0])])
    others = ahead + np.array([0.0] * 5 + [nearest_m])[:, None] * [0.0, 1.0]
    standing = np.tile(others[:, None, None], (1, 2, 6, 1))
    weight = np.array([[1.0, 0.0], *[[0.6, 0.4]] * 6])
    given = Predictions(ahead[None].repeat(7, axis=0), np.concatenate([path[None], standing]), weight, 0.4)
    return choose_modes(given, np.concatenate([[[0.0, 0.0]], others])).weight[0].tolist()


def test_a_mode_of_weight_0_is_chosen_if_others_meet_enough():
    """ln w is at least ln(1e-12) = -27.63. L = (1 - 1 / 2^3) (5 + 1 - d / 0.3 m), as both modes of the others
    meet the path: 6 L = 27.59 and 27.67 for d = 0.2235 m and 0.219 m.
    """
    assert met(0.2235) == [1.0, 0.0]
    assert met(0.219) == [0.5, 0.5]


def test_choices_are_right_where_loads_are_large():
    """60 people stand at one place: 4 * 6 L is up to 1240 nats, more than a float's exponential can hold.

    The first person has one free mode; both modes of the third meet all who stand, the second half as much.
    Between people who stand are others who are alone.
    """
    path = np.zeros((124, 2, 1, 2)) + 50.0 * np.arange(1, 125)[:, None, None, None]
    path[1::2], path[0, 0], path[2] = 2.0, 2.0, [[[2.0, 2.0]], [[2.15, 2.0]]]
    position = path[:, 0, 0].copy()
    given = Predictions(path[:, 0], path, np.tile([0.7, 0.3], (124, 1)), 0.4)
    after = choose_modes(given, position)
    expected = path[:, 0].copy()
    expected[[0, 2]] = path[[0, 2], 1]
    np.testing.assert_array_equal(after.path[:, 0], expected)
    np.testing.assert_array_equal(after.weight[:4], [[0.5, 0.5], [0.7, 0.3], [0.5, 0.5], [0.7, 0.3]])


def chosen_alone(alone, weight):
    """Order and weights of a person with given logarithms, without conflicts."""
    none, order = np.zeros(0, np.int64), np.arange(len(alone))[None].copy()
    new = np.array([weight])
    _choose(none, none, np.zeros(0), np.array([alone]), new, order)
    return order[0].tolist(), new[0].tolist()


def test_of_scores_that_are_equal_to_four_digits_the_first_wins():
    assert chosen_alone([0.0, 0.00004, -1.0], [0.4, 0.4, 0.2])[0] == [0, 1, 2]
    assert chosen_alone([0.0, 0.00006, -1.0], [0.4, 0.4, 0.2])[0] == [1, 0, 2]


@pytest.mark.parametrize(
    ("weight", "best", "order", "after"),
    [
        ([0.5, 0.3, 0.15, 0.05], 0, [0, 1, 2, 3], [0.5, 0.3, 0.15, 0.05]),
        ([0.5, 0.3, 0.15, 0.05], 1, [1, 0, 2, 3], [0.4, 0.4, 0.15, 0.05]),
        ([0.5, 0.3, 0.1, 0.1], 2, [2, 0, 1, 3], [0.25, 0.25, 0.25, 0.25]),
        ([0.5, 0.3, 0.15, 0.05], 3, [3, 0, 1, 2], [0.25, 0.25, 0.25, 0.25]),
        ([0.4, 0.4, 0.15, 0.05], 0, [0, 1, 2, 3], [0.4, 0.4, 0.15, 0.05]),
    ],
)
def test_the_chosen_mode_comes_first_and_shares_weight(weight, best, order, after):
    """Modes that were as likely or more share their weight with it evenly."""
    alone = np.full(4, -2.0)
    alone[best] = -1.0
    found = chosen_alone(alone, weight)
    assert found[0] == order
    np.testing.assert_allclose(found[1], after)


def test_nobody_and_one_mode_stay_as_they_are():
    nobody = Predictions(np.zeros((0, 2, 2)), np.zeros((0, 3, 2, 2)), np.zeros((0, 3)), 0.3)
    assert len(choose_modes(nobody, np.zeros((0, 2)))) == 0
    single = Predictions.single(np.zeros((2, 1, 2)), 0.3)
    assert choose_modes(single, np.zeros((2, 2))) is single
