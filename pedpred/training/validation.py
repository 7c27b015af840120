"""How well a motion network forecasts the sequences that it does not learn from."""

from __future__ import annotations

import numpy as np
import torch

from pedpred.datasets.motion import MotionData
from pedpred.models.motion import MotionLstm
from pedpred.models.rolling import displacement_errors, roll
from pedpred.training.machine import ALONE, Machine
from pedpred.training.progress import Progress


def validate(
    network: MotionLstm,
    data: MotionData,
    sequences: np.ndarray,
    progress: Progress,
    train_loss: float,
    machine: Machine,
) -> float:
    """Add a row to the curve and keep the weights if they are the best so far; returns the error, m."""
    network.eval()
    ade_m = validation_ade_m(network, data, sequences, machine)
    network.train()
    if ade_m < progress.best_ade_m:
        progress.best = {k: v.detach().clone() for k, v in network.state_dict().items()}
    row = {"epoch": len(progress.curve), "step": progress.step}
    progress.curve.append(row | {"train_loss": train_loss, "validation_ade_m": ade_m})
    return ade_m


def validation_ade_m(
    network: MotionLstm, data: MotionData, sequences: np.ndarray, machine: Machine = ALONE
) -> float:
    """Average displacement error over all steps whose whole horizon is known, m; nan where there is none.

    The processes of a machine divide the sequences [S, 2] among them.
    """
    mine = sequences[machine.rank :: machine.size]
    rows = np.concatenate([np.arange(a, b) for a, b in mine]) if len(mine) else np.zeros(0, np.int64)
    known = torch.from_numpy(rows).to(data.future.device)
    known = known[data.known(known).all(dim=-1)]
    error_m = displacement_errors(roll(network, data, mine)[known], data.future[known], data.dt_s)
    sums = torch.stack([error_m.double().sum(), torch.ones_like(error_m, dtype=torch.float64).sum()])
    total_m, count = machine.total(sums).tolist()
    return total_m / count if count else float("nan")
