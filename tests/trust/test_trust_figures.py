"""What was found on one machine is found on every other: committed figures, computed again."""

import json

import pytest

from pedpred.baselines.present_motion import PRESENT_MOTION, STRONGEST
from pedpred.evaluation import EvaluationSettings, measure, summarise_methods
from pedpred.evaluation.observed import find_observed_windows
from pedpred.features.perception import Perception
from pedpred.sources.eth_ucy import read_text
from pedpred.tracking import KalmanBank, KalmanSettings
from stages.eth_ucy_evaluate import fit_filter
from stages.folds import trained_sets
from stages.perception import windows_of
from tests.configuration import read
from tests.conftest import raw_folder
from tests.trust.figures import COMMITTED, TOLERANCE, measured, published

PARAMS = read("params.yaml")


def test_simulation_and_network_err_as_they_did():
    found, before = measured(), json.loads(COMMITTED.read_text())
    for scene, errors in before.items():
        assert found[scene] == pytest.approx(errors, rel=TOLERANCE), f"{scene}: see tests/trust/figures.py"
    assert found.keys() == before.keys()


@pytest.mark.parametrize("scene", ["eth", "hotel", "zara1"])
def test_real_errors_are_the_published_ones(scene):
    """Nothing amplifies a rounding here: what is published has five digits, and all of them hold.

    The filter is fitted to the recordings of the fold, which takes some time: at one scene.
    """
    study, how = PARAMS["literature"], EvaluationSettings(bootstrap=1)
    train = trained_sets(study["folds"]["eth_ucy"][scene], study["places"])
    (name,), protocol = study["scenes"][scene], windows_of(study)

    def recording(name):
        return read_text(raw_folder("eth_ucy"), name, study["places"][name]["settings"])

    methods, tracker = dict(PRESENT_MOTION), KalmanBank.around(KalmanSettings(0.1, 0.1, 1.0))
    if scene == "hotel":
        names = (at.removeprefix("real/") for at in train)
        tracker = fit_filter(map(recording, names), protocol.predicted_steps)
    else:
        del methods[STRONGEST]
    still_mps = PARAMS["protocol"]["standstill_mps"]
    how_seen = Perception(tracker, still_mps)
    windows = find_observed_windows(recording(name), how_seen, protocol, memory=False)
    scores = measure(windows, {m: make() for m, make in methods.items()}, how)
    figures = summarise_methods(scores, "cv", how)
    for method, own in figures.items():
        for key in ("ade_m", "fde_m"):
            assert own[key] == pytest.approx(published(scene)[method][key], abs=2e-5)
