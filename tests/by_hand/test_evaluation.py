"""Scores per window, their pools and summaries: values from the equations."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.evaluation import MetricSettings, Resampling, Scores, pool_scores, score
from pedpred.evaluation.measure import describe_scene
from pedpred.evaluation.scores import (
    join_scores,
    mean_scores,
    read_scores,
    write_scores,
)
from pedpred.evaluation.summary import (
    TrackBootstrap,
    coverages,
    summarise_methods,
    summarise_test_set,
)
from pedpred.evaluation.windows import integrate_truth
from pedpred.metrics import Metric
from pedpred.scenes import Predictions
from tests.by_hand.tables import table_of
from tests.forecasts import metric_scene
from tests.worlds import empty_map

TRACK = np.array([7, 7, 7, 2, 5, 5])
ADE_M = np.array([0.4, 1.0, 3.1, 0.2, np.nan, 0.9])
OTHER_M = np.array([0.5, 0.7, 3.3, 0.1, np.nan, 0.2])
ERROR_M = np.array([[0.1, 3.0], [0.2, 0.5], [0.4, 4.0], [0.9, 1.0], [1.7, 2.0], [3.0, 7.0]])
INSIDE = np.array([[0.5, 0.96], [0.2, 0.2], [0.7, 0.93], [0.90001, 0.91], [0.95, 0.1], [0.1, 0.99]])
NLL = np.array([[1.0, -2.0], [2.0, 0.5], [0.123456789, 4.0], [5.0, 2.0], [-3.0, 2.5], [0.0, 1.0]])


def scores_of(values_m=ADE_M, track=TRACK, **given):
    rows = len(track)
    usual = {"error_m": ERROR_M[:rows], "inside": INSIDE[:rows], "nll": NLL[:rows]}
    return Scores(track, {"ade_m": values_m[:rows]}, **usual | given)


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_true_paths_are_the_velocities_summed_over_time(dt_s):
    """x(p) = x + R(heading) sum_{q <= p} v(q) dt; headings of 0, 90 and 180 degrees."""
    future = np.array([[[1.0, 0.5], [2.0, 0.0], [-1.0, 1.5]]] * 3, np.float32)
    position = np.array([[1.0, 2.0], [-3.0, 0.5], [10.0, 7.0]])
    table = table_of(3, 3, future=future, position=position, heading_rad=[0.0, np.pi / 2, np.pi])
    walked = dt_s * np.array([[1.0, 0.5], [3.0, 0.5], [2.0, 2.0]])
    turned = [walked, np.stack([-walked[:, 1], walked[:, 0]], axis=-1), -walked]
    np.testing.assert_allclose(integrate_truth(table, dt_s), position[:, None] + turned, atol=1e-12)


def test_a_scene_knows_speeds_and_thresholds():
    """The speed is the length of the velocity; published thresholds are 0.3 m/s, 0.2 m and 2 m."""
    table = table_of(2, 1, time_s=[4.0, 5.5], velocity=[[0.3, -0.4], [-0.2, 0.1]])
    found = describe_scene(table, empty_map(), MetricSettings(moving_mps=0.5, collision_m=0.7, miss_m=1.1))
    np.testing.assert_allclose(found.speed_mps, [0.5, np.sqrt(0.05)])
    np.testing.assert_array_equal(found.time_s, [4.0, 5.5])
    assert (found.moving_mps, found.collision_m, found.miss_m) == (0.5, 0.7, 1.1)
    usual = describe_scene(table, empty_map(), MetricSettings())
    assert (usual.moving_mps, usual.collision_m, usual.miss_m) == (0.3, 0.2, 2.0)


def measured(covariance=None, **given):
    """Scores of two windows, three steps: errors 1, 5, 2 | 10, 0.5, 3 m along (0.6, 0.8)."""
    truth = np.array([[[1.0, 2.0], [2.0, 2.5], [4.0, 0.0]], [[-1.0, 3.0], [0.0, 0.0], [2.0, 9.0]]])
    error_m = np.array([[1.0, 5.0, 2.0], [10.0, 0.5, 3.0]])
    path = truth + error_m[..., None] * [0.6, 0.8]
    return score(Predictions.single(path, 0.4, covariance), truth, TRACK[2:4], metric_scene(2), **given)


def test_errors_and_calibration_of_each_step():
    """Sigma = s^2 I: inside 1 - exp(-e^2 / 2 s^2), -ln N = e^2 / 2 s^2 + ln(2 pi s^2)."""
    error_m = np.array([[1.0, 5.0, 2.0], [10.0, 0.5, 3.0]])
    deviation_m = np.array([[2.0, 3.0, 0.7], [4.0, 1.0, 2.5]])
    found = measured((deviation_m**2)[..., None, None] * np.eye(2))
    np.testing.assert_allclose(found.error_m, error_m)
    ratio2 = (error_m / deviation_m) ** 2
    np.testing.assert_allclose(found.inside, 1 - np.exp(-ratio2 / 2))
    np.testing.assert_allclose(found.nll, ratio2 / 2 + np.log(2 * np.pi * deviation_m**2))
    np.testing.assert_allclose(found.values["ade_m"], [8 / 3, 4.5])
    np.testing.assert_array_equal(found.track, TRACK[2:4])
    assert (found.without_truth, found.noncausal) == (0, False)


NOT_DEFINITE = [
    *([[-2.0, 0.5], [0.5, -1.0]], [[0.0, 0.0], [0.0, 1.0]], [[2.0, -3.0], [-3.0, 2.0]]),
    *([[1.0, 0.0], [0.0, np.inf]], [[np.inf, 0.0], [0.0, 1.0]], [[2.0, 0.0], [0.0, -1.0]]),
    *([[0.5, 0.6], [0.6, 0.72]], [[4.0, np.nan], [np.nan, 1.0]]),
]
"""x^T Sigma x > 0 is: variance along x > 0, determinant > 0; all finite."""


@pytest.mark.parametrize("sigma", NOT_DEFINITE)
def test_covariances_must_be_positive_definite(sigma):
    covariance = np.tile(np.eye(2), (2, 3, 1, 1))
    covariance[1, 2] = sigma
    with pytest.raises(ValueRuleError):
        measured(covariance)


@pytest.mark.parametrize("sigma", [[2, 1, 4], [0.5, 1, 4], [4, 1, 0.5], [3, -1.2, 0.9], [9, 4, 2]])
def test_positive_definite_covariances_are_measured(sigma):
    xx, xy, yy = sigma
    covariance = np.tile(np.array([[xx, xy], [xy, yy]], float), (2, 3, 1, 1))
    assert np.isfinite(measured(covariance).nll).all()


def test_calibration_needs_covariances_and_can_be_left_out():
    third = Metric("last", "m", "lower", lambda predictions, truth, scene: predictions.point[:, 2, 0])
    without = [
        measured(),
        measured(np.tile(np.eye(2), (2, 3, 1, 1)), metrics={"third_m": third}, steps=False),
    ]
    for found in without:
        assert found.inside.shape == found.nll.shape == (2, 0)
        assert found.error_m.shape == (2, 3)
    assert list(without[1].values) == ["third_m"]
    np.testing.assert_allclose(without[1].values["third_m"], [5.2, 3.8])


def test_parts_are_put_where_they_belong():
    row = np.array([2, 0, 5, 1, 3, 4])
    parts = [scores_of(ADE_M[at], TRACK[at], error_m=ERROR_M[at], inside=INSIDE[at], nll=NLL[at])
             for at in (row[:2], row[2:3], row[3:])]  # fmt: skip
    for found in (join_scores(parts, row), join_scores([scores_of()], np.arange(6))):
        assert_whole(found)


def assert_whole(found):
    np.testing.assert_array_equal(found.track, TRACK)
    np.testing.assert_array_equal(found.values["ade_m"], ADE_M)
    for name, expected in (("error_m", ERROR_M), ("inside", INSIDE), ("nll", NLL)):
        np.testing.assert_array_equal(getattr(found, name), expected)


def test_pools_keep_tracks_of_scenes_apart():
    """Scenes with tracks 7, 7, 3 | none | 7, 7, 7, 2, 5, 5 | 3, 3 have six tracks; lost windows add up."""
    first, last = np.array([7, 7, 3]), np.array([3, 3])
    nobody, third = scores_of(track=TRACK[:0]), scores_of(OTHER_M, last, without_truth=5, noncausal=True)
    found = pool_scores([scores_of(track=first), nobody, scores_of(without_truth=3), third])
    same = np.array([0, 0, 1, 2, 2, 2, 3, 4, 4, 5, 5])
    np.testing.assert_array_equal(found.track[:, None] == found.track, same[:, None] == same)
    np.testing.assert_array_equal(found.values["ade_m"], [*ADE_M[:3], *ADE_M, *OTHER_M[:2]])
    for name, values in (("error_m", ERROR_M), ("inside", INSIDE), ("nll", NLL)):
        np.testing.assert_array_equal(getattr(found, name), [*values[:3], *values, *values[:2]])
    assert (found.without_truth, found.noncausal) == (8, True)
    alone = pool_scores([scores_of()])
    assert (len(np.unique(alone.track)), alone.noncausal) == (3, False)


def test_scores_of_networks_are_averaged_window_by_window():
    """Of three seeds with 1, 2 and 6 times the values; nothing is inside the regions of the mean."""
    seeds = [scores_of(n * ADE_M, error_m=n * ERROR_M, nll=n * NLL) for n in (1, 2, 6)]
    found = mean_scores(seeds)
    for values, once in ((found.values["ade_m"], ADE_M), (found.error_m, ERROR_M), (found.nll, NLL)):
        np.testing.assert_allclose(values, 3 * once)
    assert found.inside.shape == (6, 0)
    np.testing.assert_array_equal(mean_scores(seeds[:1]).track, TRACK)


@pytest.mark.parametrize("columns", [2, 0])
def test_scores_are_read_as_they_were_written(columns, tmp_path):
    given = scores_of(inside=INSIDE[:, :columns], nll=NLL[:, :columns], without_truth=4, noncausal=True)
    given = replace(given, values=given.values | {"nll": OTHER_M})
    write_scores(given, tmp_path / "scores.parquet")
    found = read_scores(tmp_path / "scores.parquet")
    for name in ("track", "error_m", "inside", "nll"):
        np.testing.assert_array_equal(getattr(found, name), getattr(given, name))
    assert list(found.values) == ["ade_m", "nll"]
    for key, values in given.values.items():
        np.testing.assert_array_equal(found.values[key], values)
    assert (found.without_truth, found.noncausal) == (4, True)


WEIGHT = np.array([[1, 1, 1], [3, 0, 0], [0, 2, 1], [1, 0, 2], [0, 0, 3], [2, 1, 0], [0, 1, 2]])
"""How often each of three tracks occurs in seven replicates."""


def test_intervals_are_percentiles_of_means_over_drawn_windows():
    """A replicate's mean: sum_t w_t (sum of track t) / sum_t w_t (windows of track t).

    Tracks have 3, 1 and 2 windows; one of the third track has no value. Efron & Tibshirani 1993, ch. 13.
    """
    track = np.array([0, 0, 0, 1, 2, 2])
    sums, counts = np.array([4.5, 0.2, 0.9]), np.array([3, 1, 1])
    expected = np.percentile((WEIGHT * sums).sum(axis=1) / (WEIGHT * counts).sum(axis=1), [2.5, 97.5])
    np.testing.assert_allclose(TrackBootstrap(track, WEIGHT).interval(ADE_M), expected)


def test_replicates_without_any_value_are_left_out():
    """Tracks 0 and 1 have a value each, 2 and 5: the means are 3.5, 2, 5, 2, -, 3, 5."""
    track, values = np.array([0, 1, 1, 2]), np.array([2.0, np.nan, 5.0, np.nan])
    np.testing.assert_allclose(TrackBootstrap(track, WEIGHT).interval(values), [2.0, 5.0])
    nowhere = TrackBootstrap(track, WEIGHT[4:5]).interval(values)
    nothing = TrackBootstrap(track, WEIGHT).interval(np.full(4, np.nan))
    np.testing.assert_array_equal([nowhere, nothing], np.full((2, 2), np.nan))


def test_replicates_draw_tracks_with_equal_chances():
    """Three tracks three times each, however many windows they have; their indices rise with their ids."""
    found = TrackBootstrap.draw(TRACK, 4000, np.random.default_rng(3))
    np.testing.assert_array_equal(found.track, [2, 2, 2, 0, 1, 1])
    assert (found.tracks, found.weight.shape) == (3, (4000, 3))
    assert (found.weight.sum(axis=1) == 3).all()
    np.testing.assert_allclose(found.weight.mean(axis=0), 1.0, atol=0.05)
    np.testing.assert_allclose(found.weight.var(axis=0), 2 / 3, atol=0.05)  # of 3 draws with chance 1/3


SETTINGS = Resampling(bootstrap=37, seed=11)


def intervals_of(values, tracks=TRACK):
    """The 95 % interval of a mean, with the draw of `SETTINGS`, by a loop over replicates."""
    names, means = np.unique(tracks), []
    for times in np.random.default_rng(11).multinomial(len(names), np.full(len(names), 1 / len(names)), 37):
        drawn = np.concatenate([np.tile(values[tracks == t], n) for t, n in zip(names, times, strict=True)])
        if not np.isnan(drawn).all():
            means.append(np.nanmean(drawn))
    return np.percentile(means, [2.5, 97.5])


def test_summary_is_the_mean_over_windows_and_paired_differences():
    """Five windows have a value: their mean is 5.6 / 5, that of the differences to the other 0.8 / 5."""
    pool = {"mine": scores_of(without_truth=4), "other": scores_of(OTHER_M, noncausal=True)}
    found = summarise_methods(pool, "other", SETTINGS)
    mine, other = found["mine"], found["other"]
    assert (mine["ade_m"], mine["ade_m_minus_reference"]) == (1.12, 0.16)
    assert (other["ade_m"], other["ade_m_minus_reference"]) == (0.96, 0.0)
    np.testing.assert_allclose(mine["ade_m_ci95"], intervals_of(ADE_M), atol=5.1e-6)
    np.testing.assert_allclose(mine["ade_m_minus_reference_ci95"], intervals_of(ADE_M - OTHER_M), atol=5.1e-6)
    np.testing.assert_allclose(other["ade_m_ci95"], intervals_of(OTHER_M), atol=5.1e-6)
    assert (mine["windows"], mine["eligible"], mine["tracks"]) == (6, 10, 3)
    assert (other["eligible"], other["noncausal"]) == (6, True)
    assert "noncausal" not in mine


def test_each_step_has_its_mean_quartiles_and_calibration():
    """Means and quartiles by sorting six numbers: the first quartile lies a quarter of the way 2nd to 3rd."""
    found = summarise_methods({"mine": scores_of()}, "mine", SETTINGS)["mine"]
    assert found["per_step_m"] == [1.05, 2.91667]
    assert found["per_step_q25_m"] == [0.25, 1.25]
    assert found["per_step_q50_m"] == [0.65, 2.5]
    assert found["per_step_q75_m"] == [1.5, 3.75]
    assert found["per_step_nll"] == [0.85391, 1.33333]
    assert found["per_step_coverage_50"] == [0.5, 0.33333]
    assert found["per_step_coverage_90"] == [0.66667, 0.33333]
    assert found["per_step_coverage_95"] == [1.0, 0.66667]


def test_a_metric_without_any_value_is_left_out():
    nowhere = scores_of(np.full(6, np.nan), inside=INSIDE[:, :0], nll=NLL[:, :0])
    found = summarise_methods({"mine": nowhere}, "mine", SETTINGS)["mine"]
    quartiles = {f"per_step_q{q}_m" for q in (25, 50, 75)}
    assert set(found) == {"windows", "eligible", "tracks", "per_step_m"} | quartiles
    assert coverages(INSIDE[:, :0]) == {}


def test_figures_are_rounded_to_five_digits():
    found = summarise_methods({"mine": scores_of(np.full(6, 0.1234567))}, "mine", SETTINGS)["mine"]
    assert (found["ade_m"], found["ade_m_ci95"]) == (0.12346, [0.12346, 0.12346])
    assert isinstance(found["windows"], int)


def test_an_interval_without_values_is_null():
    """Only track 2, the first of three, has a value, and the single replicate does not draw it."""
    chance, values = np.full(3, 1 / 3), np.where(TRACK == 2, 0.2, np.nan)
    seed = next(s for s in range(99) if not np.random.default_rng(s).multinomial(3, chance)[0])
    settings = Resampling(bootstrap=1, seed=seed)
    found = summarise_methods({"mine": scores_of(values)}, "mine", settings)["mine"]
    assert (found["ade_m"], found["ade_m_ci95"]) == (0.2, [None, None])


def test_a_test_set_is_summarised_as_a_whole_and_by_scene():
    """Scene a: 6 windows, scene b: 3; the pool's mean is that over all windows, not that of the scenes."""
    b = np.array([7, 3, 3])
    scenes = {
        "a": {"mine": scores_of(), "other": scores_of(OTHER_M)},
        "b": {"mine": scores_of(OTHER_M + 1, b, without_truth=2), "other": scores_of(ADE_M, b)},
    }
    found = summarise_test_set("hall", scenes, "other", SETTINGS)
    assert list(found) == ["hall", "hall_a", "hall_b"]
    assert found["hall_a"] == summarise_methods(scenes["a"], "other", SETTINGS)
    assert found["hall_b"]["mine"]["ade_m"] == 2.5
    assert (found["hall_b"]["mine"]["tracks"], found["hall_b"]["mine"]["eligible"]) == (2, 5)
    assert found["hall"]["mine"]["ade_m"] == 1.6375  # (5.6 + 7.5) / 8
    assert found["hall"]["mine"]["ade_m_minus_reference"] == 0.475  # (0.8 + 3) / 8
    assert (found["hall"]["mine"]["windows"], found["hall"]["mine"]["tracks"]) == (9, 5)
    assert list(summarise_test_set("hall", {"a": scenes["a"]}, "other", SETTINGS)) == ["hall"]
