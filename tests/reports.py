"""Metrics, scenes and forecasts of made-up studies that tests of reports share."""

import numpy as np
import pandas as pd

from pedpred.models.lstm.features.grids import occupancy_crops
from pedpred.report.results import results_of
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from tests.forecasts import windows_with

STEPS = 10
MEETING = {"cv": 0.70, "ca": 0.80, "kalman_cv": 0.60, "social_force": 0.07, "lstm_nogrid": 0.50, "lstm": 0.40}
"""Errors that meet what is expected in simulation."""


def figures_of(ade_m, gap_m, spread_m):
    steps = np.linspace(0.1, 1.9, STEPS) * ade_m
    found = {"ade_m": ade_m, "ade_m_ci95": [ade_m - 0.02, ade_m + 0.03], "fde_m": 1.9 * ade_m}
    found |= {"moving_ade_m": 1.1 * ade_m, "windows": 1234, "tracks": 56, "per_step_m": steps.tolist()}
    found |= {f"per_step_q{q}_m": (steps * q / 50).tolist() for q in (25, 50, 75)}
    found |= {"obstacle_share": 0.0123, "collision_share": 0.2, "ade_m_minus_reference": gap_m}
    return found | {"ade_m_minus_reference_ci95": [gap_m - spread_m, gap_m + spread_m]}


def metrics_of(errors_m, spread_m=0.01):
    """What a metric file holds of a place with such errors, method -> ADE."""
    reference = errors_m.get("kalman_cv", 0.0)
    found = {name: figures_of(ade, ade - reference, spread_m) for name, ade in errors_m.items()}
    if "lstm" in found:
        covered = {f"per_step_coverage_{p}": [p / 100 + 0.01] * STEPS for p in (50, 90, 95)}
        found["lstm"] |= {"nll": 0.5, "per_step_nll": np.linspace(-4.0, 2.0, STEPS).tolist(), **covered}
    return found


def result_of(metrics, name=None, train=()):
    """The result of one test set: a simulated one when nothing was trained for it."""
    study, kind, usual = ("real", "real", "eth") if train else ("sim", "simulated", "sim_test")
    name = name or usual
    return results_of({name: metrics}, [{"train": train, "test": [f"{kind}/{name}"]}], study, 0.3)[0]


def room(name="hall", camera=None):
    """A room of 20 m with a block; walkers cross it eastwards, one row each 0.3 s."""
    occupied = np.zeros((200, 200), dtype=bool)
    occupied[120:140, 40:60] = True
    times, tracks = np.meshgrid(np.arange(40) * 0.3, np.arange(6), indexing="ij")
    position = np.stack([2.0 + times + tracks * 0.1, 3.0 + 2.0 * tracks], axis=-1).reshape(-1, 2)
    trajectories = Trajectories(times.ravel(), tracks.ravel(), position)
    return Scene(name, trajectories, OccupancyMap(occupied, np.zeros(2), 0.1), 0.3, camera)


def planned(scene, walkers=5, planted_s=None):
    """Windows in which the LSTM is right at `planted_s` and as good as Kalman CV elsewhere."""
    instants, people = np.arange(8) * 0.3, np.arange(walkers)
    time_s, track = np.repeat(instants, walkers), np.tile(people, len(instants))
    rows = len(time_s)
    position = np.stack([2.0 + time_s + track * 0.1, 3.0 + 2.0 * track], axis=-1)
    ahead_s = (np.arange(STEPS) + 1) * 0.3
    truth = position[:, None] + np.stack([ahead_s, np.zeros(STEPS)], axis=-1)
    kalman = truth + np.stack([np.zeros(STEPS), 0.3 * ahead_s], axis=-1)
    right = np.zeros(rows, bool) if planted_s is None else np.abs(time_s - planted_s) < 1e-6
    lstm = np.where(right[:, None, None], truth, kalman)
    crops = occupancy_crops(scene.occupancy, position, np.zeros(rows), 60, 0.1)
    spread = np.tile(ahead_s[:, None, None] ** 2 * np.diag([0.04, 0.09]), (rows, 1, 1, 1))
    own = {"track_id": track, "time_s": time_s, "packed_grid": crops}
    return windows_with(position, truth, {"kalman_cv": kalman, "lstm": lstm}, {"lstm": spread}, **own)


def curves():
    """Training curves by name."""
    curve = {"epoch": [0, 1], "step": [5, 10], "train_loss": [1.0, 0.5], "validation_ade_m": [0.5, 0.4]}
    other = {"epoch": [0], "train_loss": [3.0], "validation_loss": [4.0], "validation_iou": [0.2]}
    names = ("main_lstm", "main_lstm_nogrid", "finetune_eth_lstm")
    return {"autoencoder": pd.DataFrame(other)} | {name: pd.DataFrame(curve) for name in names}
