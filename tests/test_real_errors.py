"""Real places: errors of constant velocity are those of a short script, trackers what their command finds.

The script shares no code with the pipeline, only the rows of conf/ on how a place is sensed and tracked.
"""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from pedpred.baselines.registry import BASELINES
from pedpred.evaluation import EvaluationSettings, measure
from pedpred.evaluation.windows import find_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception, parse_tracker
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.sources import SOURCES
from pedpred.tracking import KalmanBank, KalmanSettings, log_likelihood
from tests.conftest import ROOT, raw_folder
from tests.worlds import PLACES

SENSORS = yaml.safe_load((ROOT / "conf/sensors/detectors.yaml").read_text())
TRACKERS = yaml.safe_load((ROOT / "conf/trackers/kalman.yaml").read_text())
REPORTED = json.loads((ROOT / "reports/metrics/real.json").read_text())
AHEAD_S = 0.3 * np.arange(1, 11)


def script(rows, rate_hz, every, tracker):
    """ADE of CV and of Kalman CV from rows (id, frame, x, y): [windows, 2] m."""
    errors, instants = [], np.unique(rows[:, 1])[::every]
    r, q = tracker["position_noise_m"], tracker["acceleration_noise"]
    for person in np.unique(rows[:, 0]):
        frame, *truth = rows[rows[:, 0] == person][:, 1:].T
        seen = np.isin(frame, instants)
        t, p = frame[seen] / rate_hz, np.transpose(truth)[seen]
        state, variance = np.zeros((2, 2)), np.diag([r**2, tracker["initial_speed_mps"] ** 2])
        state[:1], states = p[:1], []
        for k in range(1, len(t)):
            dt = t[k] - t[k - 1]
            step, noise = np.array([[1, dt], [0, 1]]), [[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]
            state, variance = step @ state, step @ variance @ step.T + q * np.array(noise)
            gain = variance[:, :1] / (variance[0, 0] + r**2)
            state, variance = state + gain * (p[k] - state[0]), variance - gain * variance[:1]
            if k >= 3 and t[k] + 3 <= frame[-1] / rate_hz + 1e-6:
                states.append([[p[k], (p[k] - p[k - 1]) / dt], state])
        asked = 3 + np.arange(len(states))
        future = [np.interp(t[asked, None] + AHEAD_S, frame / rate_hz, axis) for axis in truth]
        start, velocity = np.moveaxis(np.reshape(states, (-1, 2, 2, 1, 2)), 2, 0)
        away = start + AHEAD_S[:, None] * velocity - np.stack(future, axis=-1)[:, None]
        errors.append(np.linalg.norm(away, axis=-1).mean(axis=-1))
    return np.concatenate(errors)


def raw_rows(folder, settings):
    """Rows (id, frame, x, y) of a recording in time order, and its frame rate."""
    if "recording" not in settings:
        return np.loadtxt(folder / "obsmat.txt")[:, [1, 0, 2, 4]], settings["frame_rate_hz"]
    path = folder / f"{settings['recording']}.txt"
    if "frame_rate_hz" in settings:
        return np.loadtxt(path)[:, [1, 0, 2, 3]], settings["frame_rate_hz"]
    (rate_hz,) = [float(line.split(":")[1]) for line in path.read_text().splitlines() if "framerate" in line]
    return np.loadtxt(path)[:, :4], rate_hz


@pytest.fixture(scope="module", params=PLACES)
def real(request):
    """A real place: its name, its row of conf/places, the folder of its raw files, and its scene."""
    name, place = request.param, PLACES[request.param]
    _, _, data_set, *inside = Path(place["folder"]).parts
    folder = raw_folder(data_set).joinpath(*inside)
    return name, place, folder, SOURCES[place["source"]](folder, name, place["settings"])


def scored(scene, place, tracker):
    """Scores of constant velocity, the last step's and the tracker's, as the pipeline measures them."""
    how = Perception(tracker, 0.2, SensorSettings(**SENSORS[place["sensor"]]))
    windows = find_windows(scene, how, ForecastProtocol(), memory=False)
    scores = measure(windows, {m: BASELINES[m]() for m in ("cv", "kalman_cv")}, EvaluationSettings())
    return scores


def test_the_pipeline_agrees_with_a_script_and_with_what_is_reported(real):
    """The script runs the tuned filter alone; what is reported learns each person's noise from there."""
    name, place, folder, scene = real
    sensor, tracker = SENSORS[place["sensor"]], TRACKERS[place["tracker"]]
    rows, rate_hz = raw_rows(folder, place["settings"])
    every = round(rate_hz / sensor["rate_hz"]) if sensor["rate_hz"] else 1
    expected, tuned = script(rows, rate_hz, every, tracker), parse_tracker(tracker)
    for column, own in enumerate(scored(scene, place, tuned).values()):
        assert len(own.track) == pytest.approx(len(expected), rel=0.01)
        assert own.values["ade_m"].mean() == pytest.approx(expected[:, column].mean(), rel=0.02)
    for method, own in scored(scene, place, KalmanBank.around(tuned)).items():
        reported = REPORTED[name][method]
        assert (len(own.track), len(np.unique(own.track))) == (reported["windows"], reported["tracks"])
        assert own.values["ade_m"].mean() == pytest.approx(reported["ade_m"], abs=2e-5)


@pytest.mark.parametrize("real", [name for name in PLACES if f"tuned_on_{name}" in TRACKERS], indirect=True)
def test_the_committed_tracker_is_what_its_command_finds(real):
    """Perturbing any parameter of the tracker tuned_on_<place> makes the place's detections less likely."""
    name, place, _, scene = real
    seen = apply_sensor(scene, SensorSettings(**SENSORS[place["sensor"]]), np.random.default_rng(0))
    values = {key: value for key, value in TRACKERS[f"tuned_on_{name}"].items() if key != "kind"}
    best = log_likelihood(seen.trajectories, KalmanSettings(**values), 8)
    best += 1e-6 if place["source"] == "eth_ucy" else 1e-7  # splines have hardly any noise to be found
    for key, value in values.items():
        for factor in (0.95, 1.05):
            other = KalmanSettings(**values | {key: value * factor})
            assert log_likelihood(seen.trajectories, other, 8) < best, (key, factor)
