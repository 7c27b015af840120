"""Every figure of a metric file by hand, honest intervals, a real row computed again from raw files."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pedpred.evaluation import EvaluationSettings, score
from pedpred.evaluation.measure import describe_scene as scene_of_windows
from pedpred.evaluation.summary import TrackBootstrap
from pedpred.features import ForecastProtocol, extract_at_detections
from tests.forecasts import drawn_predictions, request_about
from tests.worlds import tracked, walled_scene

REPORTED = Path(__file__).resolve().parents[1] / "reports/metrics/real.json"


def test_scores_depend_on_neither_order_nor_batch():
    """Batches are whole instants: collisions concern all people of an instant."""
    scene = walled_scene(np.random.default_rng(5), detections=40)
    windows = request_about(scene, extract_at_detections(scene, tracked(scene), ForecastProtocol())).asked
    rng = np.random.default_rng(6)
    paths = drawn_predictions(rng, len(windows), steps=10)
    truth = rng.uniform(-1.5, 1.5, (len(windows), 10, 2))

    def scored(rows):
        part = windows.select(rows)
        about = scene_of_windows(part, scene.occupancy, EvaluationSettings())
        return score(paths.select(rows), truth[rows], part.track_id, about)

    whole, order = scored(np.arange(len(windows))), rng.permutation(len(windows))
    late = windows.time_s > np.median(windows.time_s)
    batches = [np.flatnonzero(~late), np.flatnonzero(late)]
    assert whole.values["collision_share"].any()
    assert min(map(len, batches)) > 0
    for rows in (order, *batches):
        part = scored(rows)
        for name in ("track", "error_m", "inside", "nll"):
            np.testing.assert_allclose(getattr(part, name), getattr(whole, name)[rows])
        for key, values in whole.values.items():
            np.testing.assert_allclose(part.values[key], values[rows], err_msg=key)


def test_intervals_hold_the_truth_about_95_times_in_100():
    """Tracks of 1 to 8 windows that share most of their error; the true mean is 1. Standard error: 1.1 %."""
    rng, repetitions, held = np.random.default_rng(0), 400, 0
    for _ in range(repetitions):
        track = np.repeat(np.arange(80), rng.integers(1, 9, 80))
        error_m = rng.gamma(4.0, 0.25, 80)[track] + rng.normal(0.0, 0.1, len(track))
        low, high = TrackBootstrap.draw(track, 300, rng).interval(error_m)
        held += low <= 1.0 <= high
    assert 0.91 <= held / repetitions <= 0.98


@pytest.mark.parametrize("place", ["eth", "hotel"])
def test_the_reported_constant_velocity_is_that_of_a_few_lines(ewap_folder, place):
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
    reported = json.loads(REPORTED.read_text())[place]["cv"]
    assert (reported["windows"], reported["tracks"]) == (len(errors), len(tracks))
    assert reported["ade_m"] == pytest.approx(np.mean(errors), abs=2e-4)
    assert reported["fde_m"] == pytest.approx(np.mean(errors, axis=0)[-1], abs=2e-4)
