"""Nothing that is tested was seen before: proven from the graph of the pipeline, and on forecasts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml

from pedpred.features import FeatureSettings, extract
from pedpred.networks import GridAutoencoder, MotionLstm
from pedpred.networks.encoding import encode
from pedpred.networks.forecasting import forecast_motion
from pedpred.tracking import KalmanSettings, follow
from tests.exported import NETWORK
from tests.worlds import walled_scene

ROOT = Path(__file__).resolve().parents[2]
STAGES = yaml.load((ROOT / "dvc.lock").read_text(), yaml.CSafeLoader)["stages"]
PARAMS = yaml.load((ROOT / "params.yaml").read_text(), yaml.CSafeLoader)
TRAINED_IN = {
    "autoencoder": {"main"},
    "corridor/lstm": {"main", "corridor"},  # the auto-encoder's convolutions come from main
    "main/lstm": {"main", "corridor"},
    "finetune_eth/lstm": {"main", "corridor", "eth"},
    "finetune_hotel/lstm": {"main", "corridor", "hotel"},
}
TESTED = list((PARAMS["evaluation"]["sim"] | PARAMS["evaluation"]["real"]).items())


def within(path, folder):
    return path == folder or path.startswith(f"{folder}/")


def behind(path):
    """Every file and folder that a path of the pipeline was made from, and itself."""
    seen, waiting = set(), [path]
    while waiting:
        now = waiting.pop()
        seen.add(now)
        for stage in STAGES.values():
            outs = [out["path"] for out in stage.get("outs", [])]
            if any(within(out, now) or within(now, out) for out in outs):
                waiting += [d["path"] for d in stage.get("deps", []) if d["path"] not in seen]
    return seen


def scenes_behind(path):
    return {Path(name).parts[2] for name in behind(path) if name.startswith("data/scenes/")}


@pytest.mark.parametrize("network", TRAINED_IN)
def test_a_network_saw_the_scenes_that_it_may_see(network):
    assert scenes_behind(f"models/{network}") <= TRAINED_IN[network]
    assert TRAINED_IN[network] - {"corridor"} <= scenes_behind(f"models/{network}")


@pytest.mark.parametrize(("test", "phase"), TESTED)
def test_a_network_is_tested_where_it_has_never_been(test, phase):
    folders = {name.split("/")[1] for name in behind("reports/metrics") if name.startswith("models/")}
    assert phase in folders
    for model in PARAMS["evaluation"]["models"]:
        assert test not in scenes_behind(f"models/{phase}/{model}")


@pytest.mark.parametrize("place", ["eth", "hotel"])
def test_what_a_place_is_measured_with_was_tuned_at_the_other(place):
    other = {"eth": "hotel", "hotel": "eth"}[place]

    def tuned(group, name):
        return yaml.safe_load((ROOT / "conf" / group / f"{name}.yaml").read_text())

    scene = PARAMS["scenes"][place]
    assert scene["tracker"] == tuned("tracker", f"tuned_on_{other}")
    assert scene["tracker"] != tuned("tracker", f"tuned_on_{place}")
    own = {"forces": scene["social_force"].get("forces")}
    assert own["forces"] != tuned("social_force", f"fitted_on_{place}").get("forces")
    assert scene["sequence"] != PARAMS["scenes"][other]["sequence"]


def test_simulated_sets_have_seeds_of_their_own():
    seeds = [PARAMS["scenes"][name]["seed"] for name in ("corridor", "main", "sim_test")]
    assert len(set(seeds)) == len(seeds)


def test_no_forecast_moves_when_the_future_does():
    """The whole chain: tracker, features, encoder, recurrent network."""
    torch.manual_seed(0)
    encoder, network = GridAutoencoder(64).eval(), MotionLstm(NETWORK).eval()
    sizes, now = FeatureSettings(), 8.0
    scene = walled_scene(np.random.default_rng(0))

    def forecast(trajectories):
        seen = replace(scene, trajectories=trajectories)
        table = extract(seen, follow(trajectories, "kalman", KalmanSettings(0.1, 0.1), 0.2), sizes)
        embeddings = encode(encoder.encoder, table.occupancy, sizes.grid_cells)
        return table.time_s, forecast_motion(network, table, embeddings, sizes)[0]

    later = scene.trajectories.time_s > now
    moved = scene.trajectories.position + later[:, None] * np.random.default_rng(1).normal(
        0, 3, (len(later), 2)
    )
    time_s, before = forecast(scene.trajectories)
    _, after = forecast(replace(scene.trajectories, position=moved))
    past = time_s <= now
    assert past.any()
    np.testing.assert_allclose(before[past], after[past], rtol=0, atol=1e-6)
    assert np.abs(before[~past] - after[~past]).max() > 0.01
