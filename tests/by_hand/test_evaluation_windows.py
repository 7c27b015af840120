"""Which detections are evaluated, what forecasters are asked, and the files of their forecasts."""

import logging
import re
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from pedpred.errors import ValueRuleError
from pedpred.evaluation import MetricSettings, given, measure
from pedpred.evaluation.forecasts import join_windows, read_forecasts, read_windows, write_windows
from pedpred.evaluation.scores import read_scores
from pedpred.evaluation.trial import Trial, evaluate_scene, forecast_windows
from pedpred.evaluation.windows import find_windows, window_rows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception, fitted
from pedpred.models.lstm.features import LstmFeatures
from pedpred.scenes import Predictions, Scene, Trajectories
from pedpred.simulation.sensor import SensorSettings
from pedpred.storage.scenes import write_scene
from pedpred.tracking import KalmanBank, KalmanSettings
from tests.by_hand.tables import table_of
from tests.forecasts import drawn_predictions, windows_with
from tests.simulated import SETTINGS as WALKING
from tests.worlds import empty_map

TRACKER = KalmanSettings(acceleration_noise=0.05, position_noise_m=0.05)
SIZES = ForecastProtocol(dt_s=0.4, horizon_steps=3, min_history=2)
HOW = Perception(TRACKER, 0.2)
SEEN = ("track_id", "time_s", "position", "heading_rad", "velocity")


def walks():
    """Tracks 4, 6 and 9 with 7, 6 and 10 detections 0.4 s apart; track 9 is not seen at 3.2 s and 3.6 s."""
    first, counts = {4: 0.0, 6: 1.2, 9: 0.8}, {4: 7, 6: 6, 9: 10}
    rows = [(first[track] + 0.4 * k, track, k) for track in (4, 6, 9) for k in range(counts[track])]
    time_s, track_id, k = (np.array(column) for column in zip(*rows, strict=True))
    position = np.stack([0.5 * k + 0.04 * k**2 - track_id, 0.3 * track_id - 0.02 * k**2], axis=-1)
    seen = ~((track_id == 9) & (np.abs(time_s - 3.4) < 0.3))
    return Scene("walks", Trajectories(time_s, track_id, position).select(seen), empty_map(), 0.4)


def standing(asked):
    return Predictions.single(np.repeat(asked.asked.position[:, None], 3, axis=1), 0.4)


WINDOWS = [(4, 0.8), (4, 1.2), (6, 2.0), (9, 1.6)]
"""Two earlier detections and three steps of truth; the gap of 1.2 s hides what lies in it."""
LOST = [(9, 2.0), (9, 2.4), (9, 2.8)]
"""Of track 9, until 4.4 s: these have two earlier detections, and their horizon meets the gap."""


def test_windows_have_a_past_and_all_of_their_future():
    request = find_windows(walks(), HOW, SIZES).request
    asked = request.asked
    found = list(zip(asked.track_id.tolist(), np.round(asked.time_s, 3).tolist(), strict=True))
    assert found == WINDOWS
    assert window_rows(request.table, SIZES, "walks")[1] == len(LOST)
    more = replace(SIZES, min_history=3)
    assert len(find_windows(walks(), HOW, more)) == 1  # of track 4


def test_a_request_tells_what_was_perceived():
    bank = KalmanBank((TRACKER, KalmanSettings(0.3, 0.1)))
    noisy = SensorSettings(position_noise_m=0.07, seed=5)
    request = find_windows(walks(), Perception(bank, 0.2, noisy), SIZES, WALKING).request
    assert (request.tracker, request.social_force, request.sizes) == (TRACKER, WALKING, SIZES)
    assert (request.detection_interval_s, request.detection_noise_m) == (0.4, 0.07)
    assert request.clock is not None
    np.testing.assert_array_equal(request.tracks.time_s, request.table.time_s)
    assert find_windows(walks(), HOW, SIZES).request.tracker == TRACKER
    lean = find_windows(walks(), HOW, SIZES, memory=False).request
    assert (lean.clock, lean.social_force, lean.detection_noise_m) == (None, None, 0.0)


def test_truth_is_where_people_are_not_where_detected():
    """The steps of 0.4 s are those of the recording, so that its positions are the true ones."""
    scene = walks()
    found = find_windows(scene, replace(HOW, sensor=SensorSettings(position_noise_m=0.2)), SIZES)
    request, predictions = found.request, standing(found.request)
    scores = measure(found, {"still": given(predictions)}, MetricSettings())
    windows = forecast_windows(found, {"still": predictions})
    true = scene.trajectories
    known = zip(true.track_id, np.round(true.time_s, 3), strict=True)
    at = {(who, time_s): row for row, (who, time_s) in enumerate(known)}
    rows = [[at[who, round(now_s + 0.4 * p, 3)] for p in (1, 2, 3)] for who, now_s in WINDOWS]
    expected = true.position[rows]
    np.testing.assert_allclose(windows.truth, expected, atol=1e-6)
    error_m = np.linalg.norm(request.asked.position[:, None] - expected, axis=-1)
    np.testing.assert_allclose(scores["still"].error_m, error_m, atol=1e-6)
    np.testing.assert_array_equal(scores["still"].track, [4, 4, 6, 9])
    assert (scores["still"].without_truth, scores["still"].noncausal) == (3, False)
    assert (windows.dt_s, list(windows.predictions)) == (0.4, ["still"])
    for name in SEEN:
        np.testing.assert_array_equal(getattr(windows, name), getattr(request.asked, name))


def test_tracks_that_know_the_future_have_no_tracker_and_say_so():
    windows = find_windows(walks(), HOW, replace(SIZES, noncausal=True))
    assert windows.request.tracker is None
    assert measure(windows, {"still": standing}, MetricSettings())["still"].noncausal


@pytest.mark.parametrize(("metrics", "steps"), [(None, 3), ({}, 0)])
def test_calibration_is_measured_with_all_metrics_only(metrics, steps):
    windows = find_windows(walks(), HOW, SIZES)
    spread = replace(standing(windows.request), covariance=np.tile(np.eye(2), (4, 1, 3, 1, 1)))
    found = measure(windows, {"still": given(spread)}, MetricSettings(), metrics)["still"]
    assert found.inside.shape == found.nll.shape == (4, steps)


def test_some_windows_are_selected_with_their_truth():
    whole = find_windows(walks(), HOW, SIZES)
    part = whole.select(np.array([3, 0]))
    found = list(zip(part.track.tolist(), np.round(part.time_s, 3).tolist(), strict=True))
    assert found == [WINDOWS[3], WINDOWS[0]]
    np.testing.assert_array_equal(part.truth, whole.truth[[3, 0]])
    np.testing.assert_array_equal(part.request.asked.time_s, part.time_s)
    assert (len(part), part.without_truth) == (2, len(LOST))


def test_grids_of_windows_are_those_of_their_people():
    shown = LstmFeatures(grid_cells=8, grid_resolution_m=0.25, angular_cells=12, max_range_m=7.5)
    found = find_windows(walks(), HOW, SIZES)
    request, windows = found.request, forecast_windows(found, {}, shown)
    inputs = request.inputs(shown, request.rows, request.asked.time_s)
    np.testing.assert_array_equal(windows.packed_grid, inputs["occupancy"])
    np.testing.assert_array_equal(windows.angular_grid_m, inputs["angular_grid"])
    assert (windows.grid_cells, windows.grid_resolution_m, windows.max_range_m) == (8, 0.25, 7.5)
    none = forecast_windows(found, {})
    assert none.packed_grid.shape == none.angular_grid_m.shape == (4, 0)
    assert none.grid_cells == 0


def stays():
    """Lives of 7, 5, 2 and 4 detections; the second one is of the same id. Horizon 1.2 s."""
    time_s = [0, 0.4, 0.8, 1.2, 1.6, 2.0, 2.4, 10, 10.4, 10.8, 11.2, 12, 3, 3.4, 5, 5.4, 5.8, 6.9999995]
    track, step = [5] * 12 + [9] * 2 + [12] * 4, [*range(7), *range(5), *range(2), *range(4)]
    known = [3, 3, 3, 1, 2, 1, 0, 1, 0, 1, 1, 0, 1, 0, 3, 2, 2, 0]
    return table_of(18, 3, time_s=time_s, track_id=track, step=step, future_steps=known)


def test_windows_are_lost_whose_person_stays_until_their_horizon():
    """Lost: 1.2 s with 2.4 s as its end, 10.8 s with 12 s, and 5.8 s with 7 s up to a microsecond."""
    table = stays()
    rows, lost = window_rows(table, SIZES, "hall")
    assert (rows.tolist(), lost) == ([2], 3)
    assert window_rows(table, replace(SIZES, min_history=1), "hall")[1] == 5  # 10.4 s and 5.4 s too
    assert window_rows(table, replace(SIZES, dt_s=0.41), "hall")[1] == 0


@pytest.mark.parametrize(("windows", "lost", "told"), [(99, 1, False), (197, 2, True), (99, 0, False)])
def test_a_share_above_one_percent_of_lost_windows_is_told(windows, lost, told, caplog):
    """1 of 100 is silent, 2 of 199 are told; the last three detections lack a part of their future."""
    step = np.arange(windows + lost + 5)
    known = np.full(len(step), 3)
    known[-3:] = [2, 1, 0]
    known[2 : 2 + lost] = 1
    table = table_of(len(step), 3, time_s=0.4 * step, step=step, future_steps=known)
    with caplog.at_level(logging.WARNING):
        assert window_rows(table, SIZES, "hall")[1] == lost
    assert bool(caplog.records) == told


def test_the_usual_interval_is_the_median_within_tracks():
    """Intervals of 1, 0.5 | 0.5, 7 s; 93 s lie between the tracks. Windows: none."""
    step, track = [0, 1, 2, 0, 1, 2], [1, 1, 1, 2, 2, 2]
    table = table_of(6, 3, time_s=[0, 1, 1.5, 94.5, 95, 102], track_id=track, step=step)
    with pytest.raises(ValueRuleError) as raised:
        window_rows(table, SIZES, "hall")
    assert "0.75" in re.findall(r"[\d.]+", str(raised.value))
    alone = table_of(2, 3, time_s=[0.0, 93.0], track_id=[1, 2])
    with pytest.raises(ValueRuleError) as raised:
        window_rows(alone, SIZES, "hall")
    assert "93" not in str(raised.value)
    with pytest.raises(ValueRuleError):
        window_rows(table_of(0, 3), SIZES, "hall")


def some_windows(**given):
    truth = np.array([[[1.0, 2.0], [2.0, 2.0], [5.0, 6.0]], [[0.0, 0.0], [0.5, 1.0], [1.5, 0.5]]])
    usual = {"packed_grid": np.zeros((2, 2), np.uint8), "grid_cells": 4, "angular_grid_m": np.zeros((2, 5))}
    paths = {"cv": truth + np.array([[[3.0, 4.0], [0.0, 1.0], [0.0, 0.0]], [[1.0, 0.0], [0, 2], [0, 9.0]]])}
    return windows_with(truth[:, 0], truth, paths, dt_s=0.4, **usual | given)


def test_windows_know_velocities_errors_and_obstacles():
    """R(90 deg) (1, 0.5) = (-0.5, 1). Errors 5, 1, 0 | 1, 2, 9 m. Cell (i, j) is bit 4 i + j, low first."""
    crop = np.array([[0b00000010, 0b10010000], [0, 0b00000001]], np.uint8)
    velocity = np.array([[1.0, 0.5], [1.0, 0.5]])
    windows = some_windows(packed_grid=crop, heading_rad=np.array([np.pi / 2, np.pi]), velocity=velocity)
    np.testing.assert_allclose(windows.world_velocity, [[-0.5, 1.0], [-1.0, -0.5]], atol=1e-12)
    np.testing.assert_allclose(windows.ade_m("cv"), [2.0, 4.0])
    cells = [np.argwhere(windows.grid(row)).tolist() for row in (0, 1)]
    assert cells == [[[0, 1], [3, 0], [3, 3]], [[2, 0]]]
    assert windows.grid(0).dtype == bool


def test_methods_with_covariances_are_named():
    many = drawn_predictions(np.random.default_rng(2), rows=2, steps=3)
    windows = replace(some_windows(), predictions=some_windows().predictions | {"many": many})
    assert windows.with_covariances == ("many",)


def methods_of(rng):
    """Forecasts of two windows, three steps: one to three modes, with covariances and without."""
    found = {}
    for modes in (1, 2, 3):
        for covariance in (True, False):
            given = drawn_predictions(rng, 2, modes, 3, covariance)
            given = replace(given, dt_s=0.4)
            found[f"{modes}_{covariance}"] = replace(given, point=given.path[:, 0]) if modes == 1 else given
    return found


@pytest.mark.parametrize("grids", [True, False])
def test_windows_are_read_as_written_in_single_precision(grids, tmp_path):
    none = {} if grids else {"packed_grid": np.zeros((2, 0), np.uint8), "angular_grid_m": np.zeros((2, 0))}
    given = some_windows(time_s=np.array([1 / 3, 7.0]), velocity=np.array([[0.1, 0.7], [2, 3]]), **none)
    given = replace(given, predictions=methods_of(np.random.default_rng(1)))
    write_windows(given, tmp_path / "hall.parquet")
    columns = pq.read_schema(tmp_path / "hall.parquet").names
    several = {f"modes_{name}" for name in given.predictions if name[0] != "1"}
    assert {name for name in columns if name.startswith("modes_")} == several
    found = read_windows(tmp_path / "hall.parquet")
    for name in (*SEEN, "packed_grid", "angular_grid_m"):
        np.testing.assert_array_equal(getattr(found, name), getattr(given, name), err_msg=name)
    for name in ("dt_s", "grid_cells", "grid_resolution_m", "max_range_m"):
        assert getattr(found, name) == getattr(given, name)
    np.testing.assert_array_equal(found.truth, given.truth.astype(np.float32))
    for method, own in given.predictions.items():
        read = found.predictions[method]
        assert (read.dt_s, read.covariance is None) == (0.4, own.covariance is None)
        for name, values in own.arrays().items():
            np.testing.assert_array_equal(getattr(read, name), values.astype(np.float32), err_msg=name)
    assert found.truth.dtype == found.predictions["3_True"].path.dtype == np.float64


def test_forecasts_of_all_methods_are_joined_by_scene(tmp_path):
    """Baselines and the networks' own folder; the order is that of the methods asked for."""
    folder, truth = tmp_path / "data/forecasts", some_windows().truth
    for group, method, scenes in (("baselines", "cv", "ab"), ("main", "lstm", "b"), ("other", "far", "b")):
        for scene in scenes:
            known = {"packed_grid": np.full((2, 2), 9, np.uint8)} if method == "lstm" else {
                "packed_grid": np.zeros((2, 0), np.uint8)}  # fmt: skip
            windows = windows_with(truth[:, 0], truth, {method: truth + len(method)}, **known)
            write_windows(windows, folder / group / method / "sim/hall" / f"{scene}.parquet")
    found = read_forecasts(tmp_path, "main", "sim/hall", ["lstm", "cv", "far", "none"])
    methods = {name: list(windows.predictions) for name, windows in found.items()}
    assert methods == {"a": ["cv"], "b": ["lstm", "cv"]}
    np.testing.assert_array_equal(found["b"].packed_grid, np.full((2, 2), 9))
    assert list(read_forecasts(tmp_path, "main", "sim/hall", ["cv"], "a")) == ["a"]
    other = replace(found["b"], time_s=found["b"].time_s + 1.0)
    with pytest.raises(ValueRuleError):
        join_windows([found["b"], other])


def test_joined_windows_have_the_first_grids_and_all_forecasts():
    bare = some_windows(packed_grid=np.zeros((2, 0), np.uint8), grid_cells=0)
    parts = [bare, *(some_windows(packed_grid=np.full((2, 2), n, np.uint8)) for n in (3, 4))]
    named = [replace(part, predictions={str(k): part.predictions["cv"]}) for k, part in enumerate(parts)]
    found = join_windows(named)
    np.testing.assert_array_equal(found.packed_grid, np.full((2, 2), 3))
    assert (list(found.predictions), found.grid_cells) == (["0", "1", "2"], 4)


def test_a_trial_writes_forecasts_and_scores_of_a_scene(tmp_path):
    given = []

    def still(asked):
        given.append(asked)
        return standing(asked)

    shown = LstmFeatures(grid_cells=4, angular_cells=6)
    trial = Trial("still", still, HOW, SIZES, WALKING, MetricSettings(miss_m=2.5), True, shown=shown)
    write_scene(walks(), tmp_path / "walks")
    evaluate_scene(tmp_path / "walks", trial, tmp_path / "forecasts", tmp_path / "scores")
    windows = read_windows(tmp_path / "forecasts/walks.parquet")
    scores = read_scores(tmp_path / "scores/walks.parquet")
    np.testing.assert_array_equal(windows.track_id, scores.track)
    np.testing.assert_allclose(windows.ade_m("still"), scores.values["ade_m"], atol=1e-6)
    np.testing.assert_array_equal(scores.values["miss_rate_k1"], scores.values["fde_m"] > 2.5)
    assert 0 < scores.values["miss_rate_k1"].mean() < 1
    assert (given[0].social_force, given[0].clock is None, windows.grid_cells) == (WALKING, False, 4)
    evaluate_scene(tmp_path / "walks", replace(trial, memory=False), tmp_path / "b", tmp_path / "c")
    assert given[1].clock is None
    evaluate_scene(tmp_path / "walks", replace(trial, fits=True), tmp_path / "d", tmp_path / "e")
    assert (given[1].tracker, given[2].tracker) == (HOW.kalman, fitted(walks(), HOW, SIZES).kalman)


def test_a_scene_without_recording_is_not_evaluated(tmp_path):
    nobody = walks().trajectories.select(np.zeros(0, int))
    write_scene(Scene("walks", nobody, empty_map(), 0.4, unavailable="no mirror"), tmp_path / "walks")
    trial = Trial("none", None, HOW, SIZES, None, MetricSettings())
    evaluate_scene(tmp_path / "walks", trial, tmp_path / "forecasts", tmp_path / "scores")
    assert [path.name for path in tmp_path.iterdir()] == ["walks"]
