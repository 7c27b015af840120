"""Requests, predictions and windows that tests share."""

import numpy as np

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.evaluation.windows import window_rows
from pedpred.features import ForecastProtocol
from pedpred.forecasting import ForecastRequest
from pedpred.metrics import MetricScene
from pedpred.report.findings import Paper
from pedpred.report.methods import Methods
from pedpred.scenes import Predictions
from pedpred.settings import load
from tests.simulated import read
from tests.worlds import empty_map

ROWS = {key: row for key, row in read("report/methods").items() if "mixture" not in key}
METHODS = Methods.parse(ROWS, "kalman_cv")
PAPER = load(Paper, read("report/paper"))


def request_about(scene, table, rows=None, **given):
    """A request for some rows of a table at detections; by default for its windows."""
    rows = window_rows(table, ForecastProtocol(), scene.name)[0] if rows is None else rows
    usual = {"sizes": ForecastProtocol(), "tracker": None, "detection_interval_s": scene.detection_dt_s}
    return ForecastRequest(scene=scene, table=table, rows=rows, **usual | given)


def metric_scene(windows, occupancy=None, **given):
    """What metrics know of a scene with so many windows, each at an instant of its own."""
    usual = {"time_s": np.arange(float(windows)), "speed_mps": np.ones(windows)}
    usual |= {"moving_mps": 0.3, "collision_m": 0.2}
    return MetricScene(occupancy=empty_map() if occupancy is None else occupancy, **usual | given)


def drawn_predictions(rng, rows=5, modes=3, steps=4, covariance=True, frame="world"):
    """Random predictions; the point forecast is the mean of the modes."""
    path = rng.normal(size=(rows, modes, steps, 2))
    weight = -np.sort(-rng.dirichlet(np.ones(modes), rows), axis=1)
    root = rng.normal(size=(rows, modes, steps, 2, 2))
    own = root @ np.swapaxes(root, -1, -2) + 0.1 * np.eye(2) if covariance else None
    point = (weight[:, :, None, None] * path).sum(axis=1)
    return Predictions(point, path, weight, 0.3, own, frame)


def windows_with(position, truth, paths, covariances=None, dt_s=0.3, **given):
    """Windows of people at `position` [W, 2] who head along x; single-mode predictions of each method."""
    rows, covariances = len(position), covariances or {}
    usual = {"track_id": np.arange(rows), "time_s": np.zeros(rows), "heading_rad": np.zeros(rows)}
    usual |= {"velocity": np.tile([1.0, 0.0], (rows, 1)), "packed_grid": np.zeros((rows, 450), np.uint8)}
    usual |= {"angular_grid_m": np.full((rows, 72), 6.0, np.float32), "grid_cells": 60}
    usual |= {"grid_resolution_m": 0.1, "max_range_m": 6.0}
    predictions = {m: Predictions.single(path, dt_s, covariances.get(m)) for m, path in paths.items()}
    usual |= {"position": position, "truth": truth, "predictions": predictions, "dt_s": dt_s}
    return EvaluationWindows(**usual | given)
