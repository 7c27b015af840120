"""Half a minute of a real street (examples/zara01): constant velocity and Kalman filter, by plain numpy.

The script shares no code with the library. Its windows are the detections of a person who has been detected
three times before and stays for 3 s; the truth is a cubic spline through the detections, 10 steps of 0.3 s.
"""

import json

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.command import main
from pedpred.evaluation import EvaluationSettings, measure, summarise_methods
from pedpred.evaluation.windows import find_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception, fitted
from pedpred.tracking import KalmanSettings
from tests.by_hand.walks import textbook
from tests.conftest import ROOT
from tests.worlds import EXCERPT, recorded

Q, R, SPEED = 0.0438, 0.0217, 0.71  # m^2/s^3, m, m/s; a filter that smooths, so that the two methods differ
AHEAD_S = 0.3 * np.arange(1, 11)
FILE = ROOT / "examples/zara01" / f"{EXCERPT}.txt"


def script(q, r, speed):
    """Errors of each method in all windows, m [W, 10], and the person of each window."""
    rows, people, errors = np.loadtxt(FILE), [], {"cv": [], "kalman_cv": []}
    for person in np.unique(rows[:, 1]):
        frame, _, *xy = rows[rows[:, 1] == person].T
        time_s, path = frame / 25, np.transpose(xy)
        for k, (state, _) in enumerate(textbook(time_s, path, q, r, speed)):
            if k >= 3 and time_s[k] + 3 <= time_s[-1] + 1e-9:
                truth = CubicSpline(time_s, path)(time_s[k] + AHEAD_S)
                last = np.array([path[k], (path[k] - path[k - 1]) / (time_s[k] - time_s[k - 1])])
                for method, (start, velocity) in {"cv": last, "kalman_cv": state}.items():
                    away = start + np.outer(AHEAD_S, velocity) - truth
                    errors[method].append(np.sqrt((away**2).sum(axis=1)))
                people.append(person)
    return {method: np.array(own) for method, own in errors.items()}, np.array(people)


def assert_figures(found, errors, people):
    """Windows, tracks, ADE and FDE of a metric file are those of the script."""
    for method, own in errors.items():
        figures = found[method]
        assert (figures["windows"], figures["tracks"]) == (len(own), len(set(people))) == (210, 12)
        assert figures["ade_m"] == pytest.approx(own.mean(), abs=2e-5)
        assert figures["fde_m"] == pytest.approx(own[:, -1].mean(), abs=2e-5)


def test_the_pipeline_finds_what_the_script_does():
    """Each error of each window, not only their means."""
    how, settings = Perception(KalmanSettings(Q, R, SPEED), 0.2), EvaluationSettings(bootstrap=10)
    windows = find_windows(recorded(EXCERPT), how, ForecastProtocol(), memory=False)
    errors, people = script(Q, R, SPEED)
    scores = measure(windows, {key: PRESENT_MOTION[key]() for key in errors}, settings)
    for method, own in errors.items():
        assert scores[method].track.tolist() == people.tolist()
        np.testing.assert_allclose(scores[method].error_m, own, atol=2e-6)
    assert_figures(summarise_methods(scores, "cv", settings), errors, people)


def test_the_command_finds_what_the_script_does(tmp_path):
    """Its filter is fitted to the recording, whatever that of the network."""
    (tmp_path / "tracker.yaml").write_text("{acceleration_noise: 1.0, position_noise_m: 1.0}")
    asked = ["evaluate", FILE, "--rate", "25", "--tracker", tmp_path / "tracker.yaml", "--samples", "10"]
    main([*map(str, asked), "--json", str(tmp_path / "errors.json")])
    (found,) = json.loads((tmp_path / "errors.json").read_text()).values()
    best = fitted(recorded(EXCERPT), Perception(KalmanSettings(1.0, 1.0), 0.2), ForecastProtocol()).kalman
    assert_figures(found, *script(*vars(best).values()))
