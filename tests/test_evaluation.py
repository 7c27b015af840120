"""Measures: hand-computed values, and no dependence on order or batch."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.baselines.registry import BASELINES, baseline
from pedpred.errors import ValueRuleError
from pedpred.evaluation import (
    EvaluationSettings,
    Scores,
    WindowSet,
    measure,
    pool_scores,
    score,
    summarise_methods,
)
from pedpred.evaluation.summary import TrackBootstrap, summarise_test_set
from pedpred.evaluation.windows import integrate_truth
from pedpred.features import ForecastProtocol, extract_at_detections
from pedpred.metrics import METRICS, Metric
from pedpred.metrics.paths import displacement, too_close
from pedpred.scenes import Predictions, Scene, Trajectories
from pedpred.tracking import KalmanSettings
from tests.forecasts import drawn_predictions, metric_scene, request_about
from tests.refused import refused
from tests.worlds import empty_map, tracked, walled_scene

SETTINGS = EvaluationSettings(bootstrap=10)


def table_of(scene):
    return extract_at_detections(scene, tracked(scene), ForecastProtocol())


def walled_request(**given):
    scene = walled_scene(np.random.default_rng(1), detections=60)
    return request_about(scene, table_of(scene), **given)


def windows_of(request):
    asked = request.asked
    return WindowSet(request, integrate_truth(asked, 0.3), asked.track_id, asked.time_s)


@given(st.integers(0, 2**32 - 1))
def test_too_close_is_symmetric_and_counts_every_step(seed):
    rng = np.random.default_rng(seed)
    paths, time_s = rng.normal(size=(20, 3, 2)), rng.integers(0, 4, 20).astype(float)
    gap = displacement(paths[:, None], paths).min(axis=-1)
    near = (gap < 0.5) & (time_s[:, None] == time_s) & ~np.eye(20, dtype=bool)
    np.testing.assert_array_equal(too_close(paths, time_s, 0.5), near.any(axis=1))


@given(st.integers(0, 2**32 - 1))
def test_summary_of_parts_pools_to_the_whole(seed):
    rng = np.random.default_rng(seed)

    def part(windows):
        moving_m = np.where(rng.random(windows) < 0.5, rng.random(windows), np.nan)
        steps = rng.random((windows, 10)), rng.exponential(2.0, (windows, 10)), rng.normal(size=(windows, 10))
        return Scores(rng.integers(0, 5, windows), {"moving_ade_m": moving_m}, *steps)

    a, b = part(30), part(20)
    whole = pool_scores([a, b])
    assert len(np.unique(whole.track)) == len(np.unique(a.track)) + len(np.unique(b.track))
    total = summarise_methods({"m": whole}, "m", EvaluationSettings(bootstrap=10))["m"]
    apart = np.concatenate([part.values["moving_ade_m"] for part in (a, b)])
    assert total["moving_ade_m"] == pytest.approx(np.nanmean(apart), abs=1e-5)
    assert total["moving_ade_m_minus_reference"] == 0
    assert total["moving_ade_m_minus_reference_ci95"] == [0, 0]
    assert np.mean(total["per_step_m"]) == pytest.approx((a.error_m.sum() + b.error_m.sum()) / 500, abs=1e-5)
    assert np.mean(total["per_step_nll"]) == pytest.approx((a.nll.sum() + b.nll.sum()) / 500, abs=1e-5)


def test_only_what_was_measured_alike_is_pooled_or_compared():
    def measured(metric, windows=4, track=0):
        steps = np.ones((windows, 2))
        return Scores(np.full(windows, track), {metric: np.ones(windows)}, steps, steps, steps)

    usual, settings = measured("ade_m"), EvaluationSettings(bootstrap=1)
    with pytest.raises(ValueRuleError):
        pool_scores([usual, measured("spread_m")])
    with pytest.raises(ValueRuleError):
        summarise_methods({"usual": usual, "other": measured("spread_m")}, "usual", settings)
    with pytest.raises(ValueRuleError):
        summarise_test_set(
            "t", {"a": {"usual": usual, "other": usual}, "b": {"usual": usual}}, "usual", settings
        )
    for other in (measured("ade_m", windows=3), measured("ade_m", track=1)):
        with pytest.raises(ValueRuleError):
            summarise_methods({"usual": usual, "other": other}, "usual", settings)


def test_bootstrap_resamples_tracks_not_windows():
    """Windows of a track that repeat each other add no certainty."""
    rng = np.random.default_rng(0)
    per_track = rng.normal(1.0, 0.3, 40)
    tracks = np.arange(40), np.repeat(np.arange(40), 25)
    drawn = [TrackBootstrap.draw(track, 2000, np.random.default_rng(1)) for track in tracks]
    once, often = drawn[0].interval(per_track), drawn[1].interval(np.repeat(per_track, 25))
    np.testing.assert_allclose(once, often)
    assert once[0] < per_track.mean() < once[1]
    spread = 2 * 1.96 * per_track.std() / np.sqrt(40)
    assert once[1] - once[0] == pytest.approx(spread, rel=0.2)


def test_baselines_are_exact_on_what_they_assume():
    time_s = np.arange(40) * 0.4
    for bend, method in ((0.0, "cv"), (0.2, "ca")):
        x = 1.2 * time_s + 0.5 * bend * time_s**2
        walk = Trajectories(time_s, np.zeros(40), np.stack([x, 0 * x], axis=-1))
        scene = Scene("walk", walk, empty_map(), 0.4)
        request = request_about(scene, table_of(scene))
        error = displacement(BASELINES[method]()(request).point, integrate_truth(request.asked, 0.3))
        # Differences give the velocity half an interval ago: with a bend of 0.2 m/s^2 that is 4 cm/s.
        assert error.max() < (0.13 if bend else 1e-6)


def test_zero_residual_is_kalman_constant_velocity():
    request = walled_request()
    windows = request.asked
    walked = np.cumsum(np.repeat(windows.velocity[:, None] * 0.3, 10, axis=1), axis=1)
    still = Predictions.single(walked, 0.3, frame="agent").in_world(windows.position, windows.heading_rad)
    np.testing.assert_allclose(still.point, BASELINES["kalman_cv"]()(request).point, atol=1e-5)


def test_several_modes_and_a_new_metric_go_through_the_same_code(monkeypatch):
    """A metric is a function and a line: mean, interval and paired difference follow."""

    def last_spread(predictions, truth, scene):
        return np.sqrt(predictions.covariance[:, 0, -1].trace(axis1=-2, axis2=-1))

    request = walled_request(tracker=KalmanSettings(0.1, 0.1))
    drawn = drawn_predictions(np.random.default_rng(0), len(request.rows), modes=7, steps=10)
    methods = {"kalman": BASELINES["kalman_cv"](), "modes": lambda asked: drawn}
    monkeypatch.setitem(METRICS, "spread_m", Metric("spread", "m", "lower", last_spread))
    scores = measure(windows_of(request), methods, SETTINGS)
    found = summarise_methods(scores, "kalman", SETTINGS)
    for key in METRICS.keys() - {"standing_ade_m"}:  # all people walk
        for name in (key, f"{key}_ci95"):
            assert np.isfinite(found["modes"][name]).all(), name
    assert found["modes"]["min_ade_m_k6"] < found["modes"]["min_ade_m_k1"]
    assert found["modes"]["spread_m_minus_reference"] == pytest.approx(
        found["modes"]["spread_m"] - found["kalman"]["spread_m"], abs=2e-5
    )


@pytest.mark.parametrize("worst", [np.nan, np.inf])
def test_a_window_that_cannot_be_measured_is_refused(worst):
    """A mean over the others alone would let a method gain by what it does not answer."""
    paths = np.zeros((3, 2, 2))
    paths[2, 1, 1] = worst
    with pytest.raises(ValueRuleError):
        score(Predictions.single(paths, 0.3), np.ones((3, 2, 2)), np.arange(3), metric_scene(3))


@pytest.mark.parametrize(
    "answer",
    [
        lambda right: replace(right, frame="agent"),
        lambda right: replace(right, dt_s=0.4),
        lambda right: right.select(np.arange(1)),
        lambda right: Predictions.single(right.point[:, :1], 0.3),
        lambda right: Predictions.single(right.point[:, :5], 0.3),
    ],
)
def test_forecasts_of_something_else_are_refused(answer):
    """One step, or one window, would be compared with all of the truth; other frames and instants too."""
    windows = windows_of(walled_request())
    right = Predictions.single(windows.truth, 0.3)
    with pytest.raises(ValueRuleError):
        measure(windows, {"theirs": lambda _: answer(right)}, SETTINGS)


@pytest.mark.parametrize("shape", [(3, 2), (2,), ()])
def test_a_metric_without_a_value_per_window_is_refused(shape):
    metric = Metric("odd", "m", "lower", lambda predictions, truth, scene: np.zeros(shape))
    truth = np.zeros((3, 2, 2))
    with refused("metrics.odd_m"):
        score(Predictions.single(truth, 0.3), truth, np.arange(3), metric_scene(3), {"odd_m": metric})


def test_figures_that_are_no_number_are_null():
    """One replicate may draw no track that has a value; JSON has no NaN."""
    values = np.array([1.0, *[np.nan] * 9])
    scores = Scores(np.arange(10), {"ade_m": values}, np.zeros((10, 2)), *[np.zeros((10, 0))] * 2)
    for seed in range(9):
        found = summarise_methods({"m": scores}, "m", EvaluationSettings(bootstrap=1, seed=seed))
        json.dumps(found, allow_nan=False)


def test_unknown_baselines_and_settings_are_named():
    with pytest.raises(ValueRuleError):
        baseline("crystal_ball", {})
    with pytest.raises(ValueRuleError):
        baseline("cv", {"speed": 1.0})


def test_a_method_that_needs_a_model_of_walking_says_so():
    with pytest.raises(ValueRuleError):
        BASELINES["social_force"]()(walled_request())
