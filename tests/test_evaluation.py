"""Figures of an evaluation: what is measured, windows, honest intervals, memory, and a real row."""

import gc
import json
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pedpred.baselines.registry import BASELINES, baseline
from pedpred.command.prediction import predictor_for
from pedpred.errors import ValueRuleError
from pedpred.evaluation import (
    EvaluationSettings,
    Scores,
    WindowSet,
    measure,
    pool_scores,
    score,
    summarise_methods,
    windows,
)
from pedpred.evaluation.summary import TrackBootstrap, summarise_test_set
from pedpred.evaluation.windows import integrate_truth
from pedpred.features import ForecastProtocol, extract_at_detections
from pedpred.features.perception import Perception
from pedpred.metrics import METRICS, Metric
from pedpred.online import OnlinePredictor
from pedpred.online.assessment import assess
from pedpred.scenes import Predictions, Scene, Trajectories
from pedpred.simulation.sensor import SensorSettings
from pedpred.tracking import KalmanSettings
from tests.conftest import ROOT
from tests.exported import TRACKER
from tests.forecasts import drawn_predictions, metric_scene, request_about
from tests.refused import refused
from tests.simulated import SETTINGS as WALKING
from tests.worlds import empty_map, jittered, tracked, walled_scene

SETTINGS = EvaluationSettings(bootstrap=10)


def table_of(scene):
    return extract_at_detections(scene, tracked(scene), ForecastProtocol())


def walled_request(**given):
    scene = walled_scene(np.random.default_rng(1), detections=60)
    return request_about(scene, table_of(scene), **given)


def windows_of(request):
    asked = request.asked
    return WindowSet(request, integrate_truth(asked, 0.3), asked.track_id, asked.time_s)


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
    walks_on = METRICS.keys() - {f"{kind}_ade_m" for kind in ("standing", "stopping", "starting")}
    for key in walks_on:
        for name in (key, f"{key}_ci95"):
            assert np.isfinite(found["modes"][name]).all(), name
    assert found["modes"]["min_ade_m_k6"] < found["modes"]["min_ade_m_k1"]
    assert found["modes"]["spread_m_minus_reference"] == pytest.approx(
        found["modes"]["spread_m"] - found["kalman"]["spread_m"], abs=2e-5
    )


def test_a_window_that_cannot_be_measured_is_refused():
    """A mean over the others alone would let a method gain by what it does not answer."""
    paths = np.zeros((3, 2, 2))
    paths[2, 1, 1] = np.nan
    with pytest.raises(ValueRuleError):
        score(Predictions.single(paths, 0.3), np.ones((3, 2, 2)), np.arange(3), metric_scene(3))


@pytest.mark.parametrize(
    "answer",
    [
        lambda right: replace(right, frame="agent"),
        lambda right: replace(right, dt_s=0.4),
        lambda right: right.select(np.arange(1)),
        lambda right: Predictions.single(right.point[:, :1], 0.3),
    ],
)
def test_forecasts_of_something_else_are_refused(answer):
    """One step, or one window, would be compared with all of the truth; other frames and instants too."""
    windows = windows_of(walled_request())
    right = Predictions.single(windows.truth, 0.3)
    with pytest.raises(ValueRuleError):
        measure(windows, {"theirs": lambda _: answer(right)}, SETTINGS)


def test_a_metric_without_a_value_per_window_is_refused():
    metric = Metric("odd", "m", "lower", lambda predictions, truth, scene: np.zeros(2))
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


def test_baselines_name_what_they_do_not_know():
    for name, given in (("crystal_ball", {}), ("cv", {"speed": 1.0})):
        with pytest.raises(ValueRuleError):
            baseline(name, given)
    with pytest.raises(ValueRuleError):
        BASELINES["social_force"]()(walled_request())  # without a model of walking


@pytest.mark.parametrize("place", ["eth", "hotel"])
def test_reported_constant_velocity_is_that_of_a_few_lines(ewap_folder, place):
    """From the raw annotations: frame, id, x, z, y, ...; frames count at 15 (eth) and 25 (hotel) a second."""
    rows = np.loadtxt(ewap_folder / f"seq_{place}" / "obsmat.txt")
    ahead_s, errors, tracks = 0.3 * np.arange(1, 11), [], set()
    for track in np.unique(rows[:, 1]):
        own = rows[rows[:, 1] == track]
        time_s, path = own[:, 0] / {"eth": 15, "hotel": 25}[place], own[:, [2, 4]]
        for k in range(3, len(own)):
            if time_s[k] + 3.0 <= time_s[-1] + 1e-6:
                pace = (path[k] - path[k - 1]) / (time_s[k] - time_s[k - 1])
                truth = CubicSpline(time_s, path)(time_s[k] + ahead_s)
                errors.append(np.hypot(*(path[k] + np.outer(ahead_s, pace) - truth).T))
                tracks.add(track)
    reported = json.loads((ROOT / "reports/metrics/real.json").read_text())[place]["cv"]
    assert (reported["windows"], reported["tracks"]) == (len(errors), len(tracks))
    assert reported["ade_m"] == pytest.approx(np.mean(errors), abs=2e-4)
    assert reported["fde_m"] == pytest.approx(np.mean(errors, axis=0)[-1], abs=2e-4)


# Windows

KALMAN = Perception(TRACKER, 0.2)
CAUSAL, NONCAUSAL = ForecastProtocol(), ForecastProtocol(noncausal=True)


def walked(dt_s, seconds=30.0, people=4):
    """People who walk straight and turn back, seen all the time."""
    time_s = np.arange(0, seconds, dt_s)
    there = np.stack([3 * np.sin(time_s / 5), 0.3 * time_s], axis=-1)
    position = np.concatenate([there + np.array([k, 0.5 * k]) for k in range(people)])
    track = np.repeat(np.arange(people), len(time_s))
    return Scene("walk", Trajectories(np.tile(time_s, people), track, position), empty_map(), dt_s)


def asked(scene, sizes=CAUSAL):
    return windows.find_windows(scene, KALMAN, sizes, WALKING).request


def test_jittered_detections_keep_their_windows(mixture):
    rare = walked(1 / 2.4)
    noisy = jittered(rare, 0.02, np.random.default_rng(0), "detection")
    for scene in (walked(0.3), rare, noisy):
        request = asked(scene)
        seconds_of_windows = len(request.rows) * scene.detection_dt_s / 4  # of each person
        assert seconds_of_windows == pytest.approx(27.0 - 3 * scene.detection_dt_s, abs=scene.detection_dt_s)
        command = assess(scene, OnlinePredictor.load(mixture[0]), SETTINGS)["network"]
        assert (len(command.track), command.without_truth) == (len(request.rows), 0)
    assert len(asked(noisy).rows) == pytest.approx(len(asked(rare).rows), rel=0.01)


def test_a_recording_slower_than_truth_allows_is_refused():
    with pytest.raises(ValueRuleError):
        asked(walked(0.8))
    assert len(asked(walked(0.8), ForecastProtocol(truth_gap_s=1.0)).rows) > 50


@pytest.mark.parametrize("sizes", [CAUSAL, NONCAUSAL])
@pytest.mark.parametrize("sensor", [SensorSettings(), SensorSettings(position_noise_m=0.1, switch_share=0.5)])
def test_an_empty_recording_is_perceived(sizes, sensor):
    scene = walked(0.4)
    nobody = replace(scene, trajectories=scene.trajectories.select(np.zeros(len(scene.trajectories), bool)))
    how = Perception(TRACKER, 0.2, sensor)
    request = windows.request_about(nobody, how, sizes, nobody.trajectories, memory=True)
    assert len(request.table) == len(request.steps) == len(request.rows) == 0


# Memory


def hall(rows):
    """People at 10 Hz, 20 at a time, on circles beside each other; each for 20 s."""
    instant, place = np.arange(rows) // 20, np.arange(rows) % 20
    angle, centre = 0.1 * instant * (0.1 + 0.01 * place) + place, np.stack([place % 5, place // 5], axis=-1)
    position = 4.0 * centre - 9.0 + 1.5 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    walker = place + 20 * ((instant + 10 * place) // 200)
    return Scene("hall", Trajectories(0.1 * instant, walker, position), empty_map(), 0.1)


@pytest.mark.slow
def test_each_detection_takes_little_memory(mixture):
    """Measured with twice as many; forecasts of all windows at once would take 12 KiB for each."""
    peaks = {}
    for rows in (1_000, 4_000, 8_000):
        scene = hall(rows)
        robot = predictor_for(scene, mixture[0])
        gc.collect()
        tracemalloc.start()
        assess(scene, robot, SETTINGS, metrics={})
        peaks[rows] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert (peaks[8_000] - peaks[4_000]) / 4_000 < 2_000


def test_intervals_hold_the_truth_about_95_times_in_100():
    """Tracks of 1 to 8 windows that share most of their error; the true mean is 1. Standard error: 1.1 %."""
    rng, repetitions, held = np.random.default_rng(0), 400, 0
    for _ in range(repetitions):
        track = np.repeat(np.arange(80), rng.integers(1, 9, 80))
        error_m = rng.gamma(4.0, 0.25, 80)[track] + rng.normal(0.0, 0.1, len(track))
        low, high = TrackBootstrap.draw(track, 300, rng).interval(error_m)
        held += low <= 1.0 <= high
    assert 0.91 <= held / repetitions <= 0.98
