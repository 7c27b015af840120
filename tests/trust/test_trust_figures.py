"""What was found on one machine is found on every other: committed figures, computed again."""

import json
from pathlib import Path

import pytest
import yaml

from pedpred.baselines.present_motion import PRESENT_MOTION, STRONGEST
from pedpred.evaluation import EvaluationSettings, summarise_methods
from pedpred.evaluation.literature import ask_about_stretches, find_stretches, score_stretches
from pedpred.tracking import KalmanSettings
from tests.trust.figures import COMMITTED, TOLERANCE, measured, published
from tests.worlds import recorded

PARAMS = yaml.safe_load((Path(__file__).resolve().parents[2] / "params.yaml").read_text())


def test_simulation_and_network_err_as_they_did():
    found, before = measured(), json.loads(COMMITTED.read_text())
    for scene, errors in before.items():
        assert found[scene] == pytest.approx(errors, rel=TOLERANCE), f"{scene}: see tests/trust/figures.py"
    assert found.keys() == before.keys()


@pytest.mark.parametrize("place", ["eth", "hotel"])
def test_real_errors_are_the_published_ones(place, ewap_folder):
    """Nothing amplifies a rounding here: what is published has five digits, and all of them hold."""
    options, literature = PARAMS["places"][place], PARAMS["literature"]
    scene = recorded(ewap_folder, place)
    steps = (literature[key] for key in ("observed_steps", "predicted_steps", "step_s"))
    found, tuned = find_stretches(scene.trajectories, *steps), PARAMS["trackers"][options["tracker"]]
    tracker = KalmanSettings(**{name: value for name, value in tuned.items() if name != "kind"})
    request, how = ask_about_stretches(scene, found, tracker), EvaluationSettings(bootstrap=1)
    scores = {m: score_stretches(request, found, make(), how) for m, make in PRESENT_MOTION.items()}
    figures = summarise_methods(scores, STRONGEST, how)
    for method, own in figures.items():
        for name in ("ade_m", "fde_m"):
            assert own[name] == pytest.approx(published(place)[method][name], abs=2e-5)
