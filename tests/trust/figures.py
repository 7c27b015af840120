"""Errors that every machine must find again within `TOLERANCE`; `python -m tests.trust.figures` writes them.

They go through all that runs outside of training: simulation, tracking, features, forecasts of the
social-force model, and the committed network on the robot's path.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from pedpred.baselines.registry import ForecastRequest, baseline
from pedpred.command.evaluation import COLLISION_M, MOVING_MPS
from pedpred.command.prediction import robot_for
from pedpred.evaluation.compare import seen_together
from pedpred.evaluation.metrics import displacement
from pedpred.evaluation.scores import true_paths
from pedpred.features import FeatureSettings, extract
from pedpred.files import write_json
from pedpred.online.assessment import assess
from pedpred.online.replay import replayed
from pedpred.scenes import Scene
from pedpred.storage.scenes import read_scene
from pedpred.tracking import follow
from tests.simulated import SOCIAL_FORCE, scene_of, short

ROOT = Path(__file__).resolve().parents[2]
COMMITTED = Path(__file__).with_name("figures.json")
MODEL = ROOT / "models" / "online" / "simulation_distilled"
TOLERANCE = 0.02
"""Relative. Other processors round otherwise: a simulation makes that larger with every second, and integer
networks are multiplied by other instructions."""
SECONDS = 20.0
"""Of simulation: so short that differences in rounding are still small."""


def as_on_a_robot(scene: Scene) -> dict[str, float]:
    """Mean errors, m, of the committed network and of what only continues the present motion."""
    predictor = robot_for(scene, MODEL)
    scores = assess(scene, predictor, replayed(scene, predictor), MOVING_MPS, COLLISION_M)
    return {method: round(float(own.error_m.mean()), 5) for method, own in scores.items()}


def by_its_own_forces(scene: Scene) -> float:
    """Mean error, m, of the simulator as a forecaster of what it simulated."""
    sizes = FeatureSettings()
    table = extract(scene, follow(scene.trajectories, "truth", None, 0.2), sizes)
    ahead_s = (np.arange(sizes.horizon_steps) + 1) * sizes.dt_s
    together = seen_together(table)
    paths = baseline("social_force")(ForecastRequest(scene, table, together, ahead_s, SOCIAL_FORCE, 0))
    window = table.window[together]
    truth = true_paths(table.select(table.window), sizes.dt_s)
    return round(float(displacement(paths[window], truth).mean()), 5)


def measured() -> dict[str, dict[str, float]]:
    """The errors found here: {scene: {method: m}}."""
    (arrangement,) = short(SECONDS, drawn=["office"])
    office = scene_of(arrangement)
    crossing = read_scene(ROOT / "examples" / "crossing")
    return {
        "crossing": as_on_a_robot(crossing),
        "office": as_on_a_robot(office) | {"social_force": by_its_own_forces(office)},
    }


def published(place: str) -> dict[str, dict]:
    """What the committed report says about a real place under the protocol of the literature."""
    return json.loads((ROOT / "reports" / "metrics" / "literature.json").read_text())[place]


if __name__ == "__main__":
    write_json(COMMITTED, measured())
    sys.stdout.write(COMMITTED.read_text())
