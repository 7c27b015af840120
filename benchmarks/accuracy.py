"""Errors in a scene, as several benchmarks of robustness compare them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pedpred.evaluation import EvaluationSettings
from pedpred.metrics import METRICS
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.assessment import assess
from pedpred.scenes import Scene
from pedpred.simulation.sensor import SensorSettings


def ade_m(
    scene: Scene, model: Path | None, settings: OnlineSettings, sensor: SensorSettings | None = None
) -> dict[str, float]:
    """Mean ADE in a scene of the network and of the baselines that continue the present motion, m.

    Args:
        scene: recorded or simulated people.
        model: a model folder; None: the shipped one.
        settings: how the network's predictor treats detections.
        sensor: between the scene and the tracker; None for a perfect one.
    """
    predictor, asked = OnlinePredictor.load(model, settings), {"ade_m": METRICS["ade_m"]}
    scores = assess(scene, predictor, EvaluationSettings(), sensor, metrics=asked)
    return {method: float(np.nanmean(each.values["ade_m"])) for method, each in scores.items()}
