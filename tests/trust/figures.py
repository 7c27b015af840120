"""Errors that every machine must find again within `TOLERANCE`; `python -m tests.trust.figures` writes them.

They go through all that runs outside of training: simulation, tracking, features, forecasts of the
social-force model, and the committed network on the robot's path.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from pedpred.command.evaluation import COLLISION_M, MOVING_MPS
from pedpred.command.prediction import robot_for
from pedpred.evaluation.compare import compare
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
MODEL = ROOT / "models" / "online" / "main_int8"
TOLERANCE = 0.02
"""Relative. Other processors round otherwise: a simulation makes that larger with every second, and integer
networks are multiplied by other instructions."""
SECONDS = 20.0
"""Of simulation: so short that differences in rounding are still small."""


def errors_m(scores: dict) -> dict[str, float]:
    """Mean displacement error of every method, m."""
    return {method: round(float(np.mean(own.error_m)), 5) for method, own in scores.items()}


def as_on_a_robot(scene: Scene) -> dict[str, float]:
    """The committed network and what only continues the present motion, as `pedpred evaluate` does it."""
    predictor = robot_for(scene, MODEL)
    return errors_m(assess(scene, predictor, replayed(scene, predictor), MOVING_MPS, COLLISION_M))


def by_its_own_forces(scene: Scene) -> dict[str, float]:
    """The simulator as a forecaster of what it simulated."""
    sizes = FeatureSettings()
    table = extract(scene, follow(scene.recording, "truth", None, 0.2), sizes)
    limits = {"moving_mps": MOVING_MPS, "collision_m": COLLISION_M}
    return errors_m(compare(scene, table, sizes, {}, ["social_force"], limits, SOCIAL_FORCE)[1])


def measured() -> dict[str, dict[str, float]]:
    """The errors found here: {scene: {method: m}}."""
    (arrangement,) = short(SECONDS, drawn=["office"])
    office = scene_of(arrangement)
    crossing = read_scene(ROOT / "examples" / "crossing")
    return {
        "crossing": as_on_a_robot(crossing),
        "office": as_on_a_robot(office) | by_its_own_forces(office),
    }


def published(place: str) -> dict[str, dict]:
    """What the committed report says about a real place under the protocol of the literature."""
    return json.loads((ROOT / "reports" / "metrics" / "literature.json").read_text())[place]


if __name__ == "__main__":
    write_json(COMMITTED, measured())
    sys.stdout.write(COMMITTED.read_text())
