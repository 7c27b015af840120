"""Real places: constant velocity and trackers err as reported, and trackers are what their command finds.

A script that shares no code with the library measures the same in `by_hand/test_real_place.py`.
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
from pedpred.features.perception import Perception, fitted
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.sources import SOURCES
from pedpred.tracking import KalmanSettings, log_likelihood
from tests.conftest import ROOT, raw_folder
from tests.worlds import PLACES

SENSORS = yaml.safe_load((ROOT / "conf/sensors/detectors.yaml").read_text())
TRACKERS = yaml.safe_load((ROOT / "conf/trackers/kalman.yaml").read_text())
REPORTED = json.loads((ROOT / "reports/metrics/real.json").read_text())


@pytest.fixture(scope="module", params=PLACES)
def real(request):
    """A real place: its name, its row of conf/places, and its scene."""
    name, place = request.param, PLACES[request.param]
    _, _, data_set, *inside = Path(place["folder"]).parts
    folder = raw_folder(data_set).joinpath(*inside)
    return name, place, SOURCES[place["source"]](folder, name, place["settings"])


def test_simple_methods_err_as_reported(real):
    """What is reported has a filter that is fitted to the place itself."""
    name, place, scene = real
    how = Perception(KalmanSettings(1.0, 1.0), 0.2, SensorSettings(**SENSORS[place["sensor"]]))
    windows = find_windows(scene, fitted(scene, how, ForecastProtocol()), ForecastProtocol(), memory=False)
    scores = measure(windows, {m: BASELINES[m]() for m in ("cv", "kalman_cv")}, EvaluationSettings())
    for method, own in scores.items():
        reported = REPORTED[name][method]
        assert (len(own.track), len(np.unique(own.track))) == (reported["windows"], reported["tracks"])
        assert own.values["ade_m"].mean() == pytest.approx(reported["ade_m"], abs=2e-5)


@pytest.mark.parametrize("real", [name for name in PLACES if f"tuned_on_{name}" in TRACKERS], indirect=True)
def test_the_committed_tracker_is_what_its_command_finds(real):
    """Perturbing any parameter of the tracker tuned_on_<place> makes the place's detections less likely."""
    name, place, scene = real
    seen = apply_sensor(scene, SensorSettings(**SENSORS[place["sensor"]]), np.random.default_rng(0))
    values = {key: value for key, value in TRACKERS[f"tuned_on_{name}"].items() if key != "kind"}
    best = log_likelihood(seen.trajectories, KalmanSettings(**values), 8)
    best += 1e-6 if place["source"] == "eth_ucy" else 1e-7  # splines have hardly any noise to be found
    for key, value in values.items():
        for factor in (0.95, 1.05):
            other = KalmanSettings(**values | {key: value * factor})
            assert log_likelihood(seen.trajectories, other, 8) < best, (key, factor)
