"""Errors that every machine must reproduce within `TOLERANCE`; `python -m tests.trust.figures` writes them.

They cover everything but training: simulation, tracking, features, forecasts of the social force model, and
the committed network in the online predictor.
"""

import json
import sys
from pathlib import Path

from pedpred.baselines.registry import BASELINES
from pedpred.command.prediction import predictor_for
from pedpred.evaluation import EvaluationSettings, find_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.files import write_json
from pedpred.metrics.paths import displacement
from pedpred.online.assessment import assess
from pedpred.scenes import Scene
from pedpred.sources.scene_folder import read_own
from tests.simulated import SETTINGS, scene_of, short
from tests.worlds import EXCERPT, recorded

ROOT = Path(__file__).resolve().parents[2]
COMMITTED = Path(__file__).with_name("figures.json")
MODEL = ROOT / "models" / "online" / "default"
TOLERANCE = 0.02
"""Relative. Processors round differently, which a simulation amplifies with time."""
SECONDS = 20.0  # simulated time, short enough that differences in rounding stay small


def as_on_a_robot(scene: Scene) -> dict[str, float]:
    """Mean errors of the committed network and of the methods of present motion, m."""
    scores = assess(scene, predictor_for(scene, MODEL), EvaluationSettings())
    return {method: round(float(own.error_m.mean()), 5) for method, own in scores.items()}


def by_its_own_forces(scene: Scene) -> float:
    """Mean error of the social force model in its own simulation, m."""
    windows = find_windows(scene, Perception(None, 0.2), ForecastProtocol(), SETTINGS)
    paths = BASELINES["social_force"]()(windows.request).point
    return round(float(displacement(paths, windows.truth).mean()), 5)


def measured() -> dict[str, dict[str, float]]:
    """Compute all errors: {scene: {method: m}}."""
    (arrangement,) = short(SECONDS, drawn=["office"])
    office = scene_of(arrangement)
    crossing = read_own(ROOT / "examples" / "crossing")
    return {
        "crossing": as_on_a_robot(crossing),
        "zara01": as_on_a_robot(recorded(EXCERPT)),
        "office": as_on_a_robot(office) | {"social_force": by_its_own_forces(office)},
    }


def published(scene: str) -> dict[str, dict]:
    """Read the committed figures of a scene of the literature."""
    return json.loads((ROOT / "reports" / "metrics" / "literature.json").read_text())[scene]


if __name__ == "__main__":
    write_json(COMMITTED, measured())
    sys.stdout.write(COMMITTED.read_text())
