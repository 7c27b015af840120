"""Loss, scores and answer of the mixture model: values and gradients from the equations."""

import numpy as np
import pytest
import torch

from pedpred.models.mixture.network import MixtureSettings

SIZES = {"modes": 3, "mirrored": False, "units": 2, "motion_units": 2, "neighbour_units": 2}
HOW = {"likelihood": 0.2, "closest": 0.4, "sharpness": 2.5, "balance_m": 0.35}
KNOWN = np.array([[1, 1, 1], [1, 1, 0], [0, 0, 0], [1, 1, 1], [1, 0, 0]], bool)
"""Row 2 is unknown; likelihoods are limited at the second step of row 1, and everywhere in row 3."""
WEIGHTS = [[0.2, 0.5, 0.3], [0.6, 0.3, 0.1], [0.4, 0.4, 0.2], [0.1, 0.2, 0.7], [0.25, 0.7, 0.05]]


def network_of(**changes):
    widths = {"state": 2, "history": 9, "track": 6, "neighbours": 5, "beams": 4}
    return MixtureSettings(**SIZES, obstacle_units=2, **HOW | changes).build(widths, 3)


def case():
    """Outputs of five rows, three modes and three steps, and the true velocities."""
    rng = np.random.default_rng(7)
    future = rng.normal(0.5, 0.8, (5, 3, 2))
    outputs = {
        "velocities": future + rng.normal(0, 0.6, (5, 3, 2)),
        "modes": future[:, None] + rng.normal(0, 0.7, (5, 3, 3, 2)),
        "weight": np.log(WEIGHTS),
        "spread": rng.normal(-0.5, 0.5, (5, 3, 3, 3)),
        "prior": future + rng.normal(0, 0.4, (5, 3, 2)) * np.arange(1, 6)[:, None, None],
    }
    future[1, 1] += [8.2, -1.5]
    future[2:4] += [20.0, 30.0]
    return outputs, future


def off(velocities, future, dt_s):
    """Position error at each step, m: the sum of dt (true - forecast velocity) up to it."""
    return np.cumsum((future - velocities) * dt_s, axis=-2)


def density(outputs, future, row, dt_s):
    """Log density of each mode at each step, ln N((e_x, e_y); a, c, k). [3, 3]"""
    x, y = np.moveaxis(off(outputs["modes"][row], future[row], dt_s), -1, 0)
    a, c = 0.01 + np.log1p(np.exp(np.moveaxis(outputs["spread"][row, ..., :2], -1, 0)))
    k = outputs["spread"][row, ..., 2]
    return -np.log(2 * np.pi * a * c) - x**2 / (2 * a**2) - (y - k * x) ** 2 / (2 * c**2)


def loss_by_hand(outputs, future, dt_s, likelihood, closest, sharpness, balance_m):
    """sum_r u_r (ADE_r + closest min_k ADE_rk) / sum_r u_r + likelihood (mean step + mean path).

    u = 1 / (balance + ADE of constant velocity); step: -ln sum_k w_k N_k, of every known step;
    path: -ln(sum_k w_k exp(s mean_p ln N_kp)) / s, of every row; both at most 20 nats.

    Returns:
        Loss, mean ADE, and the likelihoods before they are limited.
    """
    ade, both, shares, steps, paths = [], [], [], [], []
    for row in np.flatnonzero(KNOWN.any(axis=1)):
        known, weight = KNOWN[row], outputs["weight"][row][:, None]

        def distance(path, row=row, known=known):
            return np.linalg.norm(off(path, future[row], dt_s), axis=-1)[known].mean()

        ade.append(distance(outputs["velocities"][row]))
        both.append(ade[-1] + closest * min(distance(path) for path in outputs["modes"][row]))
        shares.append(1 / (balance_m + distance(outputs["prior"][row])))
        each = density(outputs, future, row, dt_s)[:, known]
        steps += list(-np.logaddexp.reduce(weight + each))
        paths.append(-np.logaddexp.reduce(weight[:, 0] + sharpness * each.mean(axis=1)) / sharpness)
    limited = np.minimum(steps, 20).mean() + np.minimum(paths, 20).mean()
    return np.average(both, weights=shares) + likelihood * limited, np.mean(ade), steps, paths


def tensors(outputs):
    """As a batch of one sub-sequence of five steps."""
    return {
        name: torch.tensor(values[None], requires_grad=name != "prior") for name, values in outputs.items()
    }


def losses(network, given, future, known, dt_s):
    return network.loss(given, torch.tensor(future[None]), torch.tensor(known[None]), dt_s)


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_loss_by_hand(dt_s):
    outputs, future = case()
    total, reported, steps, paths = loss_by_hand(outputs, future, dt_s, **HOW)
    assert [step > 20 for step in steps] == [False] * 3 + [False, True] + [True] * 3 + [False]
    assert [path > 20 for path in paths] == [False, False, True, False]
    found = losses(network_of(), tensors(outputs), future, KNOWN, dt_s)
    assert found.total.item() == pytest.approx(total, rel=1e-9)
    assert found.reported.item() == pytest.approx(reported, rel=1e-9)
    assert found.weight.item() == 4
    given = {name: values[0] for name, values in tensors(outputs).items()}  # without an axis of batches
    same = network_of().loss(given, torch.tensor(future), torch.tensor(KNOWN), dt_s)
    assert [value.item() for value in same] == pytest.approx([value.item() for value in found])


@pytest.mark.parametrize(
    ("name", "value"), [("likelihood", 0.0), ("closest", 0.0), ("sharpness", 1.0), ("balance_m", 5.0)]
)
def test_each_setting_of_the_loss_counts(name, value):
    (outputs, future), change = case(), {name: value}
    found = losses(network_of(**change), tensors(outputs), future, KNOWN, 0.4).total
    assert found.item() == pytest.approx(loss_by_hand(outputs, future, 0.4, **HOW | change)[0], rel=1e-9)


def test_loss_of_nobody_is_zero():
    outputs, future = case()
    given = tensors(outputs)
    found = losses(network_of(), given, future, KNOWN & False, 0.3)
    assert [value.item() for value in found] == [0.0, 0.0, 0.0]
    found.total.backward()
    assert not any(given[name].grad.any() for name in ("velocities", "modes", "weight", "spread"))


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_scores_are_given_at_every_step(dt_s):
    """Distances of the point and of the mode with the smallest mean; -ln sum_k w_k N_k, not limited."""
    outputs, future = case()
    network = network_of()
    found = network.scores(tensors(outputs), torch.tensor(future[None]), dt_s)
    assert tuple(found) == network.score_names == ("ade_m", "min_ade_m", "nll")
    given = {name: values[0] for name, values in tensors(outputs).items()}  # without an axis of batches
    for name, values in network.scores(given, torch.tensor(future), dt_s).items():
        np.testing.assert_array_equal(values.detach(), found[name][0].detach())
    chosen = set()
    for row in range(5):
        away = np.linalg.norm(off(outputs["modes"][row], future[row], dt_s), axis=-1)
        best = away.mean(axis=1).argmin()
        chosen.add(best)
        point = np.linalg.norm(off(outputs["velocities"][row], future[row], dt_s), axis=-1)
        each = outputs["weight"][row][:, None] + density(outputs, future, row, dt_s)
        expected = {"ade_m": point, "min_ade_m": away[best], "nll": -np.logaddexp.reduce(each)}
        for name, values in expected.items():
            np.testing.assert_allclose(found[name][0, row].detach(), values, rtol=1e-9)
    assert len(chosen) > 1


def test_best_mode_has_the_smallest_mean_distance():
    """Mean 1.0, 0.6 and 0.73 m: neither the smallest median, nor the best first or last step."""
    away = torch.tensor([[0.0, 0.0, 3.0], [0.5, 0.6, 0.7], [2.0, 0.1, 0.1]])
    zeros = torch.zeros(1, 3, 3, 3)
    outputs = {"modes": zeros[..., :2].clone(), "weight": zeros[:, 0, 0], "spread": zeros}
    outputs["modes"][0, :, :, 1] = torch.diff(away, dim=-1, prepend=torch.zeros(3, 1)) / 0.4
    outputs["velocities"] = still = zeros[:, 0, :, :2]
    found = network_of().scores(outputs, still, 0.4)["min_ade_m"]
    np.testing.assert_allclose(found, [[0.5, 0.6, 0.7]], rtol=1e-5)


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_answer_is_paths_weights_and_covariances(dt_s):
    """Positions sum up dt v; Sigma = [[a^2, k a^2], [k a^2, k^2 a^2 + c^2]]."""
    outputs, _ = case()
    found = network_of().decode(tensors(outputs), dt_s)
    a, c = 0.01 + np.log1p(np.exp(np.moveaxis(outputs["spread"][..., :2], -1, 0)))
    k = outputs["spread"][..., 2]
    covariance = np.stack([a**2, k * a**2, k * a**2, (k * a) ** 2 + c**2], axis=-1).reshape(5, 3, 3, 2, 2)
    first = dt_s * outputs["modes"][:, :, 0]
    second = first + dt_s * outputs["modes"][:, :, 1]
    expected = {
        "velocities": outputs["velocities"],
        "path": np.stack([first, second, second + dt_s * outputs["modes"][:, :, 2]], axis=2),
        "weight": np.exp(outputs["weight"]),
        "covariance": covariance,
    }
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_allclose(found[name][0].detach(), values, rtol=1e-9)
