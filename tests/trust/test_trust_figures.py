"""What was found on one machine is found on every other: committed figures, computed again."""

import json
from pathlib import Path

import pytest
import yaml

from pedpred.evaluation.literature import measures, methods, stretches
from pedpred.sources import SOURCES
from pedpred.tracking import KalmanSettings
from tests.trust.figures import COMMITTED, TOLERANCE, measured, published

PARAMS = yaml.safe_load((Path(__file__).resolve().parents[2] / "params.yaml").read_text())


def test_simulation_and_network_err_as_they_did():
    found, before = measured(), json.loads(COMMITTED.read_text())
    for scene, errors in before.items():
        assert found[scene] == pytest.approx(errors, rel=TOLERANCE), f"{scene}: see tests/trust/figures.py"
    assert found.keys() == before.keys()


@pytest.mark.parametrize("place", ["eth", "hotel"])
def test_real_errors_are_the_published_ones(place, ewap_folder):
    """Nothing amplifies a rounding here: what is published has five digits, and all of them hold."""
    options, literature = PARAMS["scenes"][place], PARAMS["literature"]
    trajectories = SOURCES[options["source"]](ewap_folder / options["sequence"], place, options).trajectories
    found = stretches(
        trajectories, *(literature[key] for key in ("observed_steps", "predicted_steps", "step_s"))
    )
    tracker = KalmanSettings(**{k: v for k, v in options["tracker"].items() if k != "kind"})
    for method, forecast in methods(tracker).items():
        figures = measures(found, forecast(found), 1, 0)
        for name in ("ade_m", "fde_m"):
            assert figures[name] == pytest.approx(published(place)[method][name], abs=2e-5)
